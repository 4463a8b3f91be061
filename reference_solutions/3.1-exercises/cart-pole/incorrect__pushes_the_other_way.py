# diagnosis: The gain on pole has the wrong sign
import numpy as np

GAINS = np.array([-3, -60, -6, -15])


def make(model):
    def act(t, observation):
        return GAINS @ observation

    return act
