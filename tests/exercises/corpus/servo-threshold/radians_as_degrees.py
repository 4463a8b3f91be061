# mistake: The start is set to pi / 180, one degree, although the angle is 1 rad; the growth then takes longer to be seen.
# next: Set data.qpos[0] = 1.0; MuJoCo's angles are in radians.
# status: partial
# told: Your runs start with hinge at 0.017 rad, not at 1 rad at
import math

import mujoco

START = math.radians(1)


def largest_stable_timestep(model, integrator):
    def stable(h):
        model.opt.timestep = h
        data = mujoco.MjData(model)
        data.qpos[0] = START
        steps = int(round(3.0 / h))
        for _ in range(steps):
            mujoco.mj_step(model, data)
            if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
                return False
        return True

    model.opt.integrator = integrator
    if stable(0.05):
        return None
    a, b = 0.001, 0.05
    while b - a > 0.00001:
        c = (a + b) / 2
        if stable(c):
            a = c
        else:
            b = c
    return a, b
