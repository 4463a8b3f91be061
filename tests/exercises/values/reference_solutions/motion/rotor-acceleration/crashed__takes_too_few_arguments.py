# diagnosis: TypeError
def acceleration(model):
    return 0.0


def energy(angle):
    return 0.0
