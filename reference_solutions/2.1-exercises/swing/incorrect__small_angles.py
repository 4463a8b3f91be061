# diagnosis: Period is what 2π√(L/g) gives. It holds for small angles
import numpy as np


def swing(model, data):
    length = -model.body_ipos[1, 2]
    period = 2 * np.pi * np.sqrt(length / 9.81)
    return {"period": period, "frequency": 1 / period, "speed": data.qpos[0] * 2 * np.pi / period}
