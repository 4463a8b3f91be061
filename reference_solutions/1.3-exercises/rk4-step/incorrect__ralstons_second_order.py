# diagnosis: This is Ralston's method of second order
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v = data.qpos.copy(), data.qvel.copy()
    mujoco.mj_forward(model, data)
    a1 = data.qacc.copy()
    data.qpos[:] = q + 2 / 3 * h * v
    data.qvel[:] = v2 = v + 2 / 3 * h * a1
    mujoco.mj_forward(model, data)
    a2 = data.qacc.copy()
    data.qpos[:] = q + h * (v + 3 * v2) / 4
    data.qvel[:] = v + h * (a1 + 3 * a2) / 4
    data.time += h
