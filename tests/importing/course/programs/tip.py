import numpy as np


def tip(angle):
    return 0.5 * np.sin(angle)
