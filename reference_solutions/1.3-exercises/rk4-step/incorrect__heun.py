# diagnosis: Heun's method
import mujoco


def rk4_step(model, data):
    h, t, q, v = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy()
    mujoco.mj_forward(model, data)
    a = data.qacc.copy()
    data.qpos[:], data.qvel[:], data.time = q + h * v, v + h * a, t + h
    mujoco.mj_forward(model, data)
    data.qpos[:], data.qvel[:] = q + h * (v + data.qvel) / 2, v + h * (a + data.qacc) / 2
