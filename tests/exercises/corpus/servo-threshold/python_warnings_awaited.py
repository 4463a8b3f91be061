# mistake: It waits for a Python warning; MuJoCo counts its warnings in data.warning and raises nothing in Python.
# next: Look at data.warning[...].number after the steps.
# status: incorrect
# told: At 50 ms MuJoCo raised BADQACC and reset the state, and your answer calls that
import warnings

import mujoco


def run(model, timestep):
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        while data.time < 3 and len(caught) == 0:
            before = data.time
            mujoco.mj_step(model, data)
            if data.time <= before:
                break
    return len(caught) == 0


def largest_stable_timestep(model, integrator):
    model.opt.integrator = int(integrator)
    a, b = 0.001, 0.05
    if run(model, b):
        return None
    while b - a >= 0.0005:
        c = (a + b) / 2
        if run(model, c):
            a = c
        else:
            b = c
    return a, b
