# diagnosis: look at data.warning[...].number
import mujoco
from mujoco import MjData, mj_step


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3.0 / timestep)):
        mj_step(model, data)
    return data.warning[mujoco.mjtWarning.mjWARN_BADQACC].lastinfo == 0


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.050
    if is_stable(model, integrator, high):
        return None
    return low, high
