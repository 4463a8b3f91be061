# diagnosis: it makes an MjData, but mj_step is not called in this case
import mujoco


def simulate(model, integrator, timestep, seconds=3.0):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    n_steps = int(seconds * timestep)
    for _ in range(n_steps):
        mujoco.mj_step(model, data)
    return data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.050
    if simulate(model, integrator, high) == 0:
        return None
    while high - low > 0.0005:
        mid = (low + high) / 2
        if simulate(model, integrator, mid) == 0:
            low = mid
        else:
            high = mid
    return (low, high)
