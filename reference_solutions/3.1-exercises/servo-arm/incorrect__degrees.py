# diagnosis: degrees and radians
import numpy as np


def control(model, data, target):
    return 40 * (target - np.degrees(data.qpos[0])) - 7 * data.qvel[0]
