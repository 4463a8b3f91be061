# mistake: It wants to switch off the automatic reset and switches off the actuators: without the servo nothing is unstable.
# next: Leave the flag mjDSBL_ACTUATION alone; mjDSBL_AUTORESET is the automatic reset.
# status: incorrect
# told: The actuators of your model are switched off (mjDSBL_ACTUATION), and without its
import mujoco


def warned(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    warning = data.warning
    for _ in range(int(3 / h) + 1):
        mujoco.mj_step(model, data)
        if warning[mujoco.mjtWarning.mjWARN_BADQPOS].number or warning[mujoco.mjtWarning.mjWARN_BADQACC].number or warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            return True
    return False


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION  # no reset, so that the warning stays
    low, high = 0.001, 0.05
    if not warned(model, high):
        return None
    while high - low > 5e-4:
        middle = (low + high) / 2
        if warned(model, middle):
            high = middle
        else:
            low = middle
    return low, high
