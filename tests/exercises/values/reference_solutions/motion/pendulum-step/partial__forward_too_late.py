# diagnosis: data.qvel is left as it was
import mujoco
import numpy as np


def step(model, data):
    h = model.opt.timestep
    data.qvel += h * data.qacc
    data.qpos += h * data.qvel
    data.time += h
    mujoco.mj_forward(model, data)


def angles(start, rate, count):
    return start + 0.1 * rate * np.arange(count)
