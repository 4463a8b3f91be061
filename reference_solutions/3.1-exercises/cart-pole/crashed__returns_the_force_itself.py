# diagnosis: TypeError: make returned a float in place of a function act(t, observation)
def make(model):
    return 0.0
