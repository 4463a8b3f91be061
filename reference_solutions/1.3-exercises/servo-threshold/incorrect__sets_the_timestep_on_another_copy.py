# diagnosis: not one whose timestep you set
"""A copy keeps the given model clean, but the copy that gets the timestep is not the one that is stepped."""
import copy

import mujoco


def survives(model, integrator, h):
    mine = copy.copy(model)
    mine.opt.timestep = h
    mine.opt.integrator = integrator
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    while data.time < 3.0:
        mujoco.mj_step(model, data)
    return not any(w.number for w in data.warning)


def largest_stable_timestep(model, integrator):
    good, bad = 0.001, 0.05
    if survives(model, integrator, bad):
        return None
    while bad - good > 0.0004:
        h = 0.5 * (good + bad)
        if survives(model, integrator, h):
            good = h
        else:
            bad = h
    return good, bad
