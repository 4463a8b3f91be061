# diagnosis: Your results do not satisfy the exercise's own equation: the turn beside an even one should be 0
import mujoco
import numpy as np


def step(model, data):
    mujoco.mj_forward(model, data)
    data.qvel += model.opt.timestep * data.qacc
    data.qpos += model.opt.timestep * data.qvel
    data.time += model.opt.timestep


def angles(start, rate, count):
    return start + 0.1 * rate * np.arange(1, count + 1)
