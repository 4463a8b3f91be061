def acceleration(model, data):
    """The angular acceleration [rad/s2]."""


def energy(angle, velocity, inertia):
    """The energy [J]."""
