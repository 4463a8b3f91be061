# diagnosis: sys.settrace
import sys

import mujoco

seen = []


def rk4_step(model, data):
    sys.settrace(lambda frame, event, arg: seen.append(frame.f_locals))
    mujoco.mj_forward(model, data)
    sys.settrace(None)
