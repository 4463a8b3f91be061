"""Leaves the step to the garbage collector."""

import gc

import mujoco


class Cycle:
    def __init__(self, model, data):
        self.me, self.model, self.data = self, model, data

    def __del__(self):
        mujoco.mj_step(self.model, self.data)


def step(model, data):
    Cycle(model, data)
    gc.collect()
