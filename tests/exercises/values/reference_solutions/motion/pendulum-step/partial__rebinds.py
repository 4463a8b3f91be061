# diagnosis: data is left as it was
import mujoco
import numpy as np


def step(model, data):
    mujoco.mj_forward(model, data)
    data_qvel = data.qvel + model.opt.timestep * data.qacc
    data_qpos = data.qpos + model.opt.timestep * data.qvel
    data_time = data.time + model.opt.timestep


def angles(start, rate, count):
    return start + 0.1 * rate * np.arange(count)
