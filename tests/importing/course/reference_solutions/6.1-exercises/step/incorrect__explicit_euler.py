# diagnosis: This is explicit Euler
import mujoco


def rk4_step(model, data):
    mujoco.mj_forward(model, data)
    h = model.opt.timestep
    data.qpos += h * data.qvel
    data.qvel += h * data.qacc
    data.time += h
