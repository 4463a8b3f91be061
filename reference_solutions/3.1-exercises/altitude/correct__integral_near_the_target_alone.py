import numpy as np


def make(model):
    weight = 9.81 * model.body_mass[1]
    state = {"sum": 0.0}

    def act(t, observation):
        height, velocity, target = observation
        error = target - height
        if abs(error) < 0.8:
            state["sum"] = np.clip(state["sum"] + 0.01 * error, -0.8, 0.8)
        return np.clip(weight + 12 * error + 8 * state["sum"] - 8 * velocity, 0, 20)

    return act
