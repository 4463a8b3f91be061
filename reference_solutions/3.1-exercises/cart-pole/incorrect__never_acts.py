# diagnosis: The controls never change
def make(model):
    return lambda t, observation: 0.0
