# mistake: Two mistakes: mj_forward lacks at the second stage, and k3 counts once.
# next: Call mj_forward at stage 2, and count k3 twice.
# status: incorrect
# told: Two things are wrong. First: In your stage 2 mj_forward is not called
import mujoco

def rk4_step(model, data):
    h = model.opt.timestep
    t0 = data.time
    q0 = data.qpos.copy()
    v0 = data.qvel.copy()
    a0 = data.act.copy()

    mujoco.mj_forward(model, data)
    k1q = data.qvel.copy()
    k1v = data.qacc.copy()
    k1a = data.act_dot.copy()

    data.qpos[:] = q0 + 0.5 * h * k1q
    data.qvel[:] = v0 + 0.5 * h * k1v
    data.act[:] = a0 + 0.5 * h * k1a
    data.time = t0 + 0.5 * h
    k2q = data.qvel.copy()
    k2v = data.qacc.copy()
    k2a = data.act_dot.copy()

    data.qpos[:] = q0 + 0.5 * h * k2q
    data.qvel[:] = v0 + 0.5 * h * k2v
    data.act[:] = a0 + 0.5 * h * k2a
    data.time = t0 + 0.5 * h
    mujoco.mj_forward(model, data)
    k3q = data.qvel.copy()
    k3v = data.qacc.copy()
    k3a = data.act_dot.copy()

    data.qpos[:] = q0 + h * k3q
    data.qvel[:] = v0 + h * k3v
    data.act[:] = a0 + h * k3a
    data.time = t0 + h
    mujoco.mj_forward(model, data)
    k4q = data.qvel.copy()
    k4v = data.qacc.copy()
    k4a = data.act_dot.copy()

    data.qpos[:] = q0 + h * (k1q + 2 * k2q + k3q + k4q) / 6
    data.qvel[:] = v0 + h * (k1v + 2 * k2v + k3v + k4v) / 6
    data.act[:] = a0 + h * (k1a + 2 * k2a + k3a + k4a) / 6
    data.time = t0 + h
