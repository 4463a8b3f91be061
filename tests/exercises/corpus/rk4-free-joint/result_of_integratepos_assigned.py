# mistake: mj_integratePos works in place and returns None, and that None is assigned to data.qpos.
# next: Call it on an array of your own, then copy that array into data.qpos[:].
# status: incorrect
# told: In your first step data.qpos or data.qvel becomes nan: None, or something that is no
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q0 = data.qpos.copy()
    v0 = data.qvel.copy()
    t0 = data.time

    mujoco.mj_forward(model, data)
    k1 = (data.qvel.copy(), data.qacc.copy())

    data.qpos = mujoco.mj_integratePos(model, q0.copy(), k1[0], h / 2)
    data.qvel[:] = v0 + h / 2 * k1[1]
    data.time = t0 + h / 2
    mujoco.mj_forward(model, data)
    k2 = (data.qvel.copy(), data.qacc.copy())

    data.qpos = mujoco.mj_integratePos(model, q0.copy(), k2[0], h / 2)
    data.qvel[:] = v0 + h / 2 * k2[1]
    mujoco.mj_forward(model, data)
    k3 = (data.qvel.copy(), data.qacc.copy())

    data.qpos = mujoco.mj_integratePos(model, q0.copy(), k3[0], h)
    data.qvel[:] = v0 + h * k3[1]
    data.time = t0 + h
    mujoco.mj_forward(model, data)
    k4 = (data.qvel.copy(), data.qacc.copy())

    data.qpos = mujoco.mj_integratePos(model, q0.copy(), (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]) / 6, h)
    data.qvel[:] = v0 + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
