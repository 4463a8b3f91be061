# diagnosis: a motor
import mujoco


def is_stable(model, integrator, timestep):
    kp, kv = model.actuator_gainprm[0, 0], -model.actuator_biasprm[0, 2]
    model.opt.integrator, model.opt.timestep = integrator, timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    while data.time < 3.0:
        data.qfrc_applied[0] = -kp * data.qpos[0] - kv * data.qvel[0]
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            model.opt.disableflags = 0
            return False
    model.opt.disableflags = 0
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
