# mistake: The bisection keeps the wrong half: where the middle is stable it lowers the upper end.
# next: Where the middle is stable, raise the lower end.
# status: incorrect
# told: After an unstable run your search goes on upwards, so that it ends at the upper
import mujoco


def warns(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3.0 / h)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            return True
    return False


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.05
    if not warns(model, integrator, high):
        return None
    while high - low > 0.0005:
        mid = (low + high) / 2
        if warns(model, integrator, mid):
            low = mid
        else:
            high = mid
    return low, high
