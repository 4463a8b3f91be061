"""The plain way."""

import mujoco


def step(model, data):
    mujoco.mj_step(model, data)
