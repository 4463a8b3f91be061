# mistake: Swinging beyond pi is not the task's test: unstable is when MuJoCo warns.
# next: Count a run as unstable when MuJoCo warns.
# status: partial
# told: At 24.73 ms your run raised no warning within 0.074 s, where you ended it, and you call it
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
        if abs(data.qpos[0]) > 3.1416:
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
