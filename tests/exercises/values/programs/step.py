import mujoco
import numpy as np


def step(model, data):
    mujoco.mj_forward(model, data)
    data.qvel += model.opt.timestep * data.qacc
    data.qpos += model.opt.timestep * data.qvel
    data.time += model.opt.timestep


def not_turning_evenly(start, rate, count, angles):
    if angles.shape != (count,):
        raise ValueError("as many angles as asked")
    return np.append(np.diff(angles) - 0.1 * rate, angles[0] - start)
