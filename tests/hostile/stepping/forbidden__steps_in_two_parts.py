"""mj_step1 and mj_step2."""

from mujoco import mj_step1, mj_step2


def step(model, data):
    mj_step1(model, data)
    mj_step2(model, data)
