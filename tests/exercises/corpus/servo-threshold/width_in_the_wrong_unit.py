# mistake: The width 0.5 is meant in milliseconds but compared with seconds, so the bisection stops before it begins.
# next: Compare with 0.0005 s.
# status: incorrect
# told: You return the whole range of the search, 1 and 50 ms: no timestep between them was tried
import mujoco

TOLERANCE = 0.5  # ms


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3.0 / timestep)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.05
    if is_stable(model, integrator, high):
        return None
    while high - low > TOLERANCE:
        mid = (low + high) / 2
        if is_stable(model, integrator, mid):
            low = mid
        else:
            high = mid
    return low, high
