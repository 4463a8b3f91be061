# diagnosis: mass and length from the file
import mujoco

from mjcourse import model_path


def servo_is_stable(kp: float, kv: float, integrator: int, timestep: float, seconds: float = 3.0) -> bool:
    xml = model_path("pendulum").read_text().replace(
        '<motor name="torque" joint="hinge" ctrlrange="-3 3"/>',
        f'<position name="servo" joint="hinge" kp="{kp}" kv="{kv}"/>',
    )
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.integrator, model.opt.timestep = integrator, timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    while data.time < seconds:
        mujoco.mj_step(model, data)
    return data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 0


def largest_stable_timestep(model, integrator):
    kp, kv = model.actuator_gainprm[0, 0], -model.actuator_biasprm[0, 2]
    low, high = 0.001, 0.05
    if servo_is_stable(kp, kv, integrator, high):
        return None
    while high - low > 0.0005:
        middle = (low + high) / 2
        if servo_is_stable(kp, kv, integrator, middle):
            low = middle
        else:
            high = middle
    return low, high
