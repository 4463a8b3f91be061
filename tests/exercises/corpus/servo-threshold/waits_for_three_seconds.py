# mistake: It steps `while data.time < 3` without looking for the reset; after a reset it starts at 1 rad again, and the loop never ends.
# next: Leave the loop as soon as a warning is raised or time runs backwards.
# status: timed_out
# told: The script used up its CPU time of 20 s.
import mujoco


def stays_stable(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    resets = 0
    while data.time < 3.0:
        t = data.time
        mujoco.mj_step(model, data)
        if data.time < t:
            resets += 1
            data.qpos[0] = 1.0  # start again
    return resets == 0


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    if stays_stable(model, 0.05):
        return None
    a, b = 0.001, 0.05
    while b - a > 0.0005:
        c = (a + b) / 2
        if stays_stable(model, c):
            a = c
        else:
            b = c
    return a, b
