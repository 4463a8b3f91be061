# mistake: The function that is to say whether a run is stable returns whether a warning was raised.
# next: Return that no warning was raised.
# status: incorrect
# told: Your test is the wrong way round
import mujoco


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(int(3.0 / timestep)):
        mujoco.mj_step(model, data)
    return data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0


def largest_stable_timestep(model, integrator):
    if is_stable(model, integrator, 0.05):
        return None
    low, high = 0.001, 0.05
    while high - low > 0.0005:
        middle = 0.5 * (low + high)
        if is_stable(model, integrator, middle):
            low = middle
        else:
            high = middle
    return low, high
