# mistake: mj_integratePos is given the weighted accelerations in place of the weighted velocities.
# next: Pass the weighted sum of the stage velocities to mj_integratePos.
# status: incorrect
# told: Your positions move by accelerations: the slope of data.qpos is data.qvel, and the
import mujoco


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q, v, a = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def slope(kv, ka, kact, part):
        data.qpos[:] = q
        mujoco.mj_integratePos(model, data.qpos, kv, part)
        data.qvel[:] = v + part * ka
        data.act[:] = a + part * kact
        data.time = t + part
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = slope(0 * v, 0 * v, 0 * a, 0.0)
    k2 = slope(*k1, h / 2)
    k3 = slope(*k2, h / 2)
    k4 = slope(*k3, h)
    dv, da, dact = [(k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]) / 6 for i in range(3)]
    data.qpos[:] = q
    mujoco.mj_integratePos(model, data.qpos, da, h)
    data.qvel[:] = v + h * da
    data.act[:] = a + h * dact
    data.time = t + h
