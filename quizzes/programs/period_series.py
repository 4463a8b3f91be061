import numpy as np


def periods(model, data, x):
    """The series up to the second order: too short from large angles."""
    small = 2 * np.pi * np.sqrt(-model.body_ipos[1, 2] / 9.81)
    return {"period": small * (1 + x**2 / 16)}
