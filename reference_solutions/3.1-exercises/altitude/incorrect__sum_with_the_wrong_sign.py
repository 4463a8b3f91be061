# diagnosis: The sum of the errors acts with the wrong sign
def make(model):
    total = 0.0

    def act(t, observation):
        nonlocal total
        height, climb, target = observation
        error = target - height
        total -= 0.01 * error
        return 9.81 + 12 * error - 6 * climb + 2 * total

    return act
