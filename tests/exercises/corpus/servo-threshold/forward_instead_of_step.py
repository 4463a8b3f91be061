# mistake: It calls mj_forward in the loop, which does not move time forward, so nothing ever happens.
# next: Call mj_step.
# status: incorrect
# told: Your function returned None without a single
import mujoco


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3.0 / timestep)):
        mujoco.mj_forward(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
            return False
    return True


def largest_stable_timestep(model, integrator):
    if is_stable(model, integrator, 0.05):
        return None
    low, high = 0.001, 0.05
    while high - low > 0.0005:
        mid = (low + high) / 2
        if is_stable(model, integrator, mid):
            low = mid
        else:
            high = mid
    return low, high
