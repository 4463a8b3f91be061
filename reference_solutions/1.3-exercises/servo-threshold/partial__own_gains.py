# diagnosis: the same answer for every model
import mujoco

from mjcourse import model_path


def is_stable(servo, integrator, timestep):
    model = mujoco.MjModel.from_xml_path(str(model_path("pendulum_servo")))
    model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1], model.actuator_biasprm[0, 2] = 2000, -2000, -5
    model.opt.integrator, model.opt.timestep = integrator, timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    while data.time < 3.0:
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
