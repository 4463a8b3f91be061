# diagnosis: too short
import mujoco


def is_stable(model, integrator, timestep):
    model.opt.integrator, model.opt.timestep = integrator, timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    while data.time < 0.5:
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    stable, unstable = 0.001, 0.05
    if is_stable(model, integrator, unstable):
        return None
    while unstable - stable > 0.0005:
        middle = (stable + unstable) / 2
        if is_stable(model, integrator, middle):
            stable = middle
        else:
            unstable = middle
    return stable, unstable
