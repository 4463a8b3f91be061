# diagnosis: do not depend on pole_rate
def make(model):
    return lambda t,o: 10000*o[1]
