import mujoco
import numpy as np


def control(model, data, target):
    wanted = 60 * (target - data.qpos[0]) - 14 * data.qvel[0]
    torque = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, torque, np.array([wanted]))
    data.ctrl[:] = torque + data.qfrc_bias - data.qfrc_passive
