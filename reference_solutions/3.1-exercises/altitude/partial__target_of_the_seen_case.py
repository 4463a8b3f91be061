# diagnosis: The controls do not depend on the target
def make(model):
    def act(t, observation):
        height, climb, target = observation
        return 9.81 + 12 * (1 - height) - 6 * climb

    return act
