# diagnosis: semi-implicit Euler
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    mujoco.mj_forward(model, data)
    data.qvel[:] += h * data.qacc
    data.qpos[:] += h * data.qvel
    data.time += h
