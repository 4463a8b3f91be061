# mistake: k1 is taken from the previous call's k4 to save an evaluation; the state of k4 is not the start of the next step
# status: incorrect
# told: The positions and velocities in your stage 1 are not those at the start of the step
import mujoco
import numpy as np

_last = None


def rk4_step(model, data):
    global _last
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def slope(k, dt):
        data.qpos[:] = q + dt * k[0]
        data.qvel[:] = v + dt * k[1]
        data.act[:] = w + dt * k[2]
        data.time = t + dt
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    # the end of the last step is the start of this one: only 3 evaluations needed
    if t == 0 or _last is None:
        k1 = slope((np.zeros(model.nv), np.zeros(model.nv), np.zeros(model.na)), 0)
    else:
        k1 = _last
    k2 = slope(k1, h / 2)
    k3 = slope(k2, h / 2)
    k4 = slope(k3, h)
    data.qpos[:] = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = w + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t + h
    _last = k4
