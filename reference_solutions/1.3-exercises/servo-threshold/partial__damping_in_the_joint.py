# diagnosis: the joint's damping
import mujoco


def is_stable(model, kv, integrator, timestep):
    model.actuator_biasprm[0, 2] = 0
    model.dof_damping[0] = kv  # the damping belongs to the joint, does it not?
    model.opt.integrator, model.opt.timestep = integrator, timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    while data.time < 3.0:
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    kv = -model.actuator_biasprm[0, 2]
    stable, unstable = 0.001, 0.05
    if is_stable(model, kv, integrator, unstable):
        return None
    while unstable - stable > 0.0005:
        middle = (stable + unstable) / 2
        if is_stable(model, kv, integrator, middle):
            stable = middle
        else:
            unstable = middle
    return stable, unstable
