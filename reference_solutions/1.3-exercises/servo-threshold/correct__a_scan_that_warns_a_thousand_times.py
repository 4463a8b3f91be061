"""Every tenth of a millisecond from the top down: MuJoCo warns at each unstable one."""

import mujoco


def is_stable(model, integrator, h):
    model.opt.integrator, model.opt.timestep = integrator, h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3 / h / 20) + 1):
        mujoco.mj_step(model, data, 20)
        if any(warning.number for warning in data.warning):
            return False
    return True


def largest_stable_timestep(model, integrator):
    tenths = 500
    while tenths > 10 and not is_stable(model, integrator, tenths / 10000):
        tenths -= 1
    return None if tenths == 500 else (tenths / 10000, (tenths + 1) / 10000)
