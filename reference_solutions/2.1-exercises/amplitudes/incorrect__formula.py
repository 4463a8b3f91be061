# diagnosis: Period is the same for every x
import numpy as np


def periods(model, data, x):
    return {"period": np.full(len(x), 2 * np.pi * np.sqrt(-model.body_ipos[1, 2] / 9.81))}
