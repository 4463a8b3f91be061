# diagnosis: far too large
import numpy as np

GAINS = np.array([30000, 6000000, 600000, 1500000])


def make(model):
    def act(t, observation):
        return GAINS @ observation

    return act
