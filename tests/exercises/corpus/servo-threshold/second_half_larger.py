# mistake: A run counts as unstable where the second half swings further than the first; the reset after a warning makes the second half small.
# next: Look at data.warning after the steps.
# status: incorrect
# told: At 50 ms MuJoCo raised BADQACC and reset the state
import mujoco
import numpy as np


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    n = int(3.0 / timestep)
    q = np.zeros(n)
    for i in range(n):
        mujoco.mj_step(model, data)
        q[i] = data.qpos[0]
    return np.abs(q[n // 2:]).max() <= np.abs(q[: n // 2]).max()


def largest_stable_timestep(model, integrator):
    if is_stable(model, integrator, 0.05):
        return None
    low, high = 0.001, 0.05
    while high - low > 0.0005:
        middle = (low + high) / 2
        if is_stable(model, integrator, middle):
            low = middle
        else:
            high = middle
    return low, high
