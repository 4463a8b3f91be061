# mistake: The gains are overwritten with the lesson's kp = 2000 and kv = 5 in every model, so other servos are not measured.
# next: Leave the gains of the given model as they are.
# status: partial
# told: The model that you step is not the one you were given: the servo's
import mujoco


def is_stable(model, integrator, timestep):
    # the lesson's case
    model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1] = 2000, -2000
    model.actuator_biasprm[0, 2] = -5
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    before = 0.0
    while data.time < 3.0:
        mujoco.mj_step(model, data)
        if data.time < before:
            return False
        before = data.time
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
