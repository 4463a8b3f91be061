# diagnosis: It does not settle at the target soon enough
import numpy as np


def control(model, data, target):
    torque = 40 * (target - data.qpos[0]) - 7 * data.qvel[0] + data.qfrc_bias[0]
    return np.sign(torque) * np.sqrt(abs(torque))
