# mistake: You load the model from the file (kp = 100) and ignore the one you are given.
# next: Step the model that the function gets.
# status: incorrect
# told: The model that you step is not the one you were given: the servo's bias (kp and kv) and the
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
    model = mujoco.MjModel.from_xml_path(str(model_path("pendulum_servo")))
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
