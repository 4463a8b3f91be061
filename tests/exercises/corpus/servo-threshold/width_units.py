# mistake: WIDTH = 0.5 is in ms while your bounds are in s, so the loop never runs.
# next: Write the width in seconds, 0.0005.
# status: incorrect
# told: You return the whole range of the search, 1 and 50 ms: no timestep between them was tried. If
import mujoco
from mjcourse import model_path

SHORTEST, LONGEST = 0.001, 0.050
WIDTH = 0.5  # half a ms
SECONDS = 3.0


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(SECONDS / timestep)):
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
