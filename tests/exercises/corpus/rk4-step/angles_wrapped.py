# mistake: Angles are wrapped into half a turn either way after each step, which moves qpos by whole turns (and wraps slides as well).
# next: Leave data.qpos as it comes out of the step.
# status: partial
# told: You wrap angles into one turn: MuJoCo does not, so leave data.qpos as it comes out of the
import mujoco
import numpy as np


def wrap(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def rates(dt=0.0, kq=0.0, kv=0.0, ka=0.0):
        data.qpos[:] = q + dt * kq
        data.qvel[:] = v + dt * kv
        data.act[:] = act + dt * ka
        data.time = t + dt
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = rates()
    k2 = rates(h / 2, *k1)
    k3 = rates(h / 2, *k2)
    k4 = rates(h, *k3)
    total = [h / 6 * (a + 2 * b + 2 * c + d) for a, b, c, d in zip(k1, k2, k3, k4)]
    data.qpos[:] = wrap(q + total[0])
    data.qvel[:] = v + total[1]
    data.act[:] = act + total[2]
    data.time = t + h
