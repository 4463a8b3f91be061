# diagnosis: The target, as the controls use it
import numpy as np
def control(model, data, target):
    u = 80 * (np.deg2rad(target) - data.qpos[0]) - 8 * data.qvel[0] + data.qfrc_bias[0]
    return u
