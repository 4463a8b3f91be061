# diagnosis: not 0
import mujoco


def is_unstable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    while data.time < 3.0:
        t = data.time
        mujoco.mj_step(model, data)
        if data.time <= t:
            return True
    return False


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.05
    if not is_unstable(model, integrator, high):
        return 0
    while high - low > 5e-4:
        middle = (low + high) / 2
        if is_unstable(model, integrator, middle):
            high = middle
        else:
            low = middle
    return low, high
