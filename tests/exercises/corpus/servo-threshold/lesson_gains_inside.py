# mistake: the lesson's gains (2000, 5) are written into the given model inside the function, so every servo becomes the lesson's
# status: partial
# told: The model that you step is not the one you were given: the servo's bias (kp and kv)
import mujoco

WARN = mujoco.mjtWarning.mjWARN_BADQACC


def is_stable(model, integrator, timestep):
    # kp and kv of the exercise
    model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1] = 2000, -2000
    model.actuator_biasprm[0, 2] = -5
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(int(3.0 / timestep + 0.5)):
        mujoco.mj_step(model, data)
        if data.warning[WARN].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    if is_stable(model, integrator, 0.050):
        return None
    low, high = 0.001, 0.050
    while high - low > 0.0005:
        mid = 0.5 * (low + high)
        if is_stable(model, integrator, mid):
            low = mid
        else:
            high = mid
    return low, high
