# mistake: The middle positions are moved for h instead of h/2, while the velocities move for h/2.
# next: Pass h / 2 to mj_integratePos for k2 and k3.
# status: incorrect
# told: For the position: your stages 2 and 3 are evaluated at the end of the step; evaluate them
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q0 = data.qpos.copy(); v0 = data.qvel.copy(); act0 = data.act.copy(); t0 = data.time

    mujoco.mj_forward(model, data)
    k1v = data.qvel.copy(); k1a = data.qacc.copy(); k1s = data.act_dot.copy()

    data.qpos[:] = q0
    mujoco.mj_integratePos(model, data.qpos, k1v, h)
    data.qvel[:] = v0 + 0.5 * h * k1a
    data.act[:] = act0 + 0.5 * h * k1s
    data.time = t0 + 0.5 * h
    mujoco.mj_forward(model, data)
    k2v = data.qvel.copy(); k2a = data.qacc.copy(); k2s = data.act_dot.copy()

    data.qpos[:] = q0
    mujoco.mj_integratePos(model, data.qpos, k2v, h)
    data.qvel[:] = v0 + 0.5 * h * k2a
    data.act[:] = act0 + 0.5 * h * k2s
    mujoco.mj_forward(model, data)
    k3v = data.qvel.copy(); k3a = data.qacc.copy(); k3s = data.act_dot.copy()

    data.qpos[:] = q0
    mujoco.mj_integratePos(model, data.qpos, k3v, h)
    data.qvel[:] = v0 + h * k3a
    data.act[:] = act0 + h * k3s
    data.time = t0 + h
    mujoco.mj_forward(model, data)
    k4v = data.qvel.copy(); k4a = data.qacc.copy(); k4s = data.act_dot.copy()

    data.qpos[:] = q0
    mujoco.mj_integratePos(model, data.qpos, (k1v + 2*k2v + 2*k3v + k4v) / 6, h)
    data.qvel[:] = v0 + h * (k1a + 2*k2a + 2*k3a + k4a) / 6
    data.act[:] = act0 + h * (k1s + 2*k2s + 2*k3s + k4s) / 6
