# diagnosis: The controls stay at one end of what the actuator gives
import numpy as np


def control(model, data, target):
    return float(np.clip(400 * (data.qpos[0] - target), -12, 12))
