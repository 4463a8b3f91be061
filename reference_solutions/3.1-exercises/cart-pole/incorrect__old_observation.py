# diagnosis: follow what was observed one step before
import numpy as np


def make(model):
    kept = [np.zeros(4)]

    def act(t, observation):
        force = np.array([3, 60, 6, 1.2]) @ kept[0]
        kept[0] = observation
        return force

    return act
