# diagnosis: The gain on pole is off by the factor between degrees and radians
import numpy as np


def make(model):
    def act(t, observation):
        cart, pole, cart_rate, pole_rate = observation
        return 3 * cart + 60 * np.degrees(pole) + 6 * cart_rate + 15 * np.degrees(pole_rate)

    return act
