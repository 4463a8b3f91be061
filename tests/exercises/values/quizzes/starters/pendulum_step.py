def step(model, data):
    """Advances data by model.opt.timestep."""


def angles(start, rate, count):
    """The angles [rad]."""
