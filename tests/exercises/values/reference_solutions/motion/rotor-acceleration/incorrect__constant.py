# diagnosis: You give the same results for every call
def acceleration(model, data):
    return 1.5


def energy(angle, velocity, inertia):
    return 0.2
