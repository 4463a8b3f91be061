# diagnosis: data.time is left as it was
import mujoco
import numpy as np


def step(model, data):
    h = model.opt.timestep
    mujoco.mj_forward(model, data)
    data.qvel += h * data.qacc
    data.qpos += h * data.qvel


def angles(start, rate, count):
    return start + 0.1 * rate * np.arange(count)
