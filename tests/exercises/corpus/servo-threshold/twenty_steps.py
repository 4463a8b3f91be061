# mistake: Every run has only 20 steps, too few for an instability to grow into a warning, and the last timestep without a warning is taken.
# next: Run for 3 s, round(3 / h) steps, and stop at the first unstable timestep.
# status: incorrect
# told: Your runs are too short: each takes 20 steps, 0.43 s at 21.5 ms, not 3
import mujoco
import numpy as np


def warned(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(20):  # blows up quickly if at all
        mujoco.mj_step(model, data)
    return data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0


def largest_stable_timestep(model, integrator):
    grid = np.linspace(0.001, 0.05, 99)
    bad = np.array([warned(model, integrator, h) for h in grid])
    if not bad.any():
        return None
    good = grid[~bad]
    h = good[-1]
    return h, h + 0.0005
