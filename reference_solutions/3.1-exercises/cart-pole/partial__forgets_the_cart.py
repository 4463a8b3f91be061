# diagnosis: The controls do not depend on cart
import numpy as np

GAINS = np.array([0, 60, 0, 15])


def make(model):
    def act(t, observation):
        return GAINS @ observation

    return act
