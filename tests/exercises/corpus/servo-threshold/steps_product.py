# mistake: seconds * timestep rather than seconds / timestep: no step is taken at all.
# next: Divide the seconds by the timestep.
# status: incorrect
# told: Your function returned None without a single step: it makes an MjData, but mj_step is not
import mujoco
from mjcourse import model_path

SHORTEST, LONGEST = 0.001, 0.050
WIDTH = 0.0005
SECONDS = 3.0


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(int(SECONDS * timestep)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
            return False
    return True


def largest_stable_timestep(model, integrator):
    if is_stable(model, integrator, LONGEST):
        return None
    low, high = SHORTEST, LONGEST
    while high - low > WIDTH:
        mid = (low + high) / 2
        if is_stable(model, integrator, mid):
            low = mid
        else:
            high = mid
    return low, high
