# mistake: You return the stable bound twice.
# next: Return the unstable end as the second.
# status: partial
# told: Your search is right: 19.76 ms stayed stable, and at 20.14 ms MuJoCo warned; but you return
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
    return low, low
