# mistake: Gravity is added to data.qacc, which holds it.
# next: Integrate data.qacc as it is.
# status: incorrect
# told: Your accelerations are data.qacc plus -9.81
import mujoco

def rk4_step(model, data):
    h = model.opt.timestep
    t0 = data.time
    q0 = data.qpos.copy()
    v0 = data.qvel.copy()
    a0 = data.act.copy()

    mujoco.mj_forward(model, data)
    k1q = data.qvel.copy()
    k1v = data.qacc + model.opt.gravity[2]
    k1a = data.act_dot.copy()

    data.qpos[:] = q0 + 0.5 * h * k1q
    data.qvel[:] = v0 + 0.5 * h * k1v
    data.act[:] = a0 + 0.5 * h * k1a
    data.time = t0 + 0.5 * h
    mujoco.mj_forward(model, data)
    k2q = data.qvel.copy()
    k2v = data.qacc + model.opt.gravity[2]
    k2a = data.act_dot.copy()

    data.qpos[:] = q0 + 0.5 * h * k2q
    data.qvel[:] = v0 + 0.5 * h * k2v
    data.act[:] = a0 + 0.5 * h * k2a
    data.time = t0 + 0.5 * h
    mujoco.mj_forward(model, data)
    k3q = data.qvel.copy()
    k3v = data.qacc + model.opt.gravity[2]
    k3a = data.act_dot.copy()

    data.qpos[:] = q0 + h * k3q
    data.qvel[:] = v0 + h * k3v
    data.act[:] = a0 + h * k3a
    data.time = t0 + h
    mujoco.mj_forward(model, data)
    k4q = data.qvel.copy()
    k4v = data.qacc + model.opt.gravity[2]
    k4a = data.act_dot.copy()

    data.qpos[:] = q0 + h * (k1q + 2 * k2q + 2 * k3q + k4q) / 6
    data.qvel[:] = v0 + h * (k1v + 2 * k2v + 2 * k3v + k4v) / 6
    data.act[:] = a0 + h * (k1a + 2 * k2a + 2 * k3a + k4a) / 6
    data.time = t0 + h
