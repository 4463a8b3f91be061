# mistake: k1 reads data.qacc without calling mj_forward first: it belongs to the last stage of the previous call (zero at first)
# status: incorrect
# told: Your first acceleration is data.qacc as it stood before the step: nothing has
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    q = data.qpos.copy()
    v = data.qvel.copy()
    a = data.act.copy()

    # data already holds the accelerations of the current state
    k1 = (v.copy(), data.qacc.copy(), data.act_dot.copy())

    def stage(k, step):
        data.qpos[:] = q + step * k[0]
        data.qvel[:] = v + step * k[1]
        data.act[:] = a + step * k[2]
        data.time = t + step
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k2 = stage(k1, h / 2)
    k3 = stage(k2, h / 2)
    k4 = stage(k3, h)

    data.qpos[:] = q + h * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]) / 6
    data.qvel[:] = v + h * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1]) / 6
    data.act[:] = a + h * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2]) / 6
    data.time = t + h
