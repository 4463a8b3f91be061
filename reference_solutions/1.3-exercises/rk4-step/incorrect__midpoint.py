# diagnosis: This is the midpoint method
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v = data.qpos.copy(), data.qvel.copy()
    mujoco.mj_forward(model, data)
    data.qpos[:] = q + h / 2 * v
    data.qvel[:] = v + h / 2 * data.qacc
    mujoco.mj_forward(model, data)
    v_mid = data.qvel.copy()
    data.qpos[:] = q + h * v_mid
    data.qvel[:] = v + h * data.qacc
    data.time += h
