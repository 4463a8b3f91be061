# mistake: The run starts at the target, at rest, so nothing ever grows and no timestep looks unstable.
# next: Set data.qpos[0] = 1.0 before stepping.
# status: incorrect
# told: Your runs start with hinge at 0, where nothing moves, so that nothing can
import mujoco


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bad = [mujoco.mjtWarning.mjWARN_BADQACC, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQPOS]
    for _ in range(int(3.0 / timestep)):
        mujoco.mj_step(model, data)
        if any(data.warning[b].number > 0 for b in bad):
            return False
    return True


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.050
    if is_stable(model, integrator, high):
        return None
    while high - low > 0.0005:
        mid = 0.5 * (low + high)
        if is_stable(model, integrator, mid):
            low = mid
        else:
            high = mid
    return low, high
