# mistake: mj_resetData is called in each step to get a clean state, which also clears ctrl and the forces.
# next: Do not reset data; set qpos, qvel, act and time yourself.
# status: partial
# told: data.ctrl differs in your calls of mj_forward from before the step: data.ctrl must
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, w0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def slope(q, v, w, t):
        mujoco.mj_resetData(model, data)  # clean slate, otherwise old stuff stays in data
        data.qpos[:] = q
        data.qvel[:] = v
        data.act[:] = w
        data.time = t
        mujoco.mj_forward(model, data)
        return v, data.qacc.copy(), data.act_dot.copy()

    k1 = slope(q0, v0, w0, t0)
    k2 = slope(q0 + h / 2 * k1[0], v0 + h / 2 * k1[1], w0 + h / 2 * k1[2], t0 + h / 2)
    k3 = slope(q0 + h / 2 * k2[0], v0 + h / 2 * k2[1], w0 + h / 2 * k2[2], t0 + h / 2)
    k4 = slope(q0 + h * k3[0], v0 + h * k3[1], w0 + h * k3[2], t0 + h)

    data.qpos[:] = q0 + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    data.qvel[:] = v0 + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = w0 + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t0 + h
