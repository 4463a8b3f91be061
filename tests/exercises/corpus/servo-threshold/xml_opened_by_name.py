# mistake: The function opens models/pendulum.xml relative to the student's own folder instead of using the model that is given.
# next: Use the parameter `model`; it is compiled already.
# status: crashed
# told: FileNotFoundError: [Errno 2] No such file or directory:
import mujoco


def servo_xml(kp, kv):
    with open("models/pendulum.xml") as f:
        xml = f.read()
    return xml.replace('<motor name="torque" joint="hinge" ctrlrange="-3 3"/>', f'<position joint="hinge" kp="{kp}" kv="{kv}"/>')


def servo_is_stable(kp, kv, integrator, timestep, seconds=3.0):
    model = mujoco.MjModel.from_xml_string(servo_xml(kp, kv))
    model.opt.integrator, model.opt.timestep = integrator, timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(seconds / timestep)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    kp = model.actuator_gainprm[0, 0]
    kv = -model.actuator_biasprm[0, 2]
    lo, hi = 0.001, 0.05
    if servo_is_stable(kp, kv, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if servo_is_stable(kp, kv, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
