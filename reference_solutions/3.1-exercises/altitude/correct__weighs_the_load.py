"""Estimates the load from what the thrust should have done, with a slow observer."""


def make(model):
    load, guess, thrust = 0.0, None, 0.0

    def act(t, observation):
        nonlocal load, guess, thrust
        height, velocity, target = observation
        if guess is None:
            guess = velocity
        guess += 0.01 * (thrust - 9.81 - load)
        gap = velocity - guess
        guess += 0.1 * gap
        load -= 0.2 * gap
        speed = max(-1.5, min(1.5, 1.2 * (target - height)))
        thrust = min(max(9.81 + load + 5 * (speed - velocity), 0.0), 20.0)
        return thrust

    return act
