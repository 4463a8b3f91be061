# diagnosis: This is the velocity Verlet method
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    mujoco.mj_forward(model, data)
    a, v = data.qacc.copy(), data.qvel.copy()
    data.qpos += h * v + h**2 / 2 * a
    data.qvel += h * a
    mujoco.mj_forward(model, data)
    data.qvel[:] = v + h / 2 * (a + data.qacc)
    data.time += h
