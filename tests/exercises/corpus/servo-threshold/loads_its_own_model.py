# mistake: It measures a pendulum_servo loaded by itself with kp = 2000 and kv = 5, not the model that was handed over.
# next: Use the parameter `model`.
# status: partial
# told: The function gave the same answer for every model, although their limits
import mujoco
from mjcourse import model_path


def make_servo(kp, kv):
    m = mujoco.MjModel.from_xml_path(str(model_path("pendulum_servo")))
    m.actuator_gainprm[0, 0] = kp
    m.actuator_biasprm[0, 1] = -kp
    m.actuator_biasprm[0, 2] = -kv
    return m


def servo_is_stable(kp, kv, integrator, timestep, seconds=3.0):
    m = make_servo(kp, kv)
    m.opt.integrator, m.opt.timestep = integrator, timestep
    d = mujoco.MjData(m)
    d.qpos[0] = 1.0
    for _ in range(round(seconds / timestep)):
        mujoco.mj_step(m, d)
        if d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or d.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if servo_is_stable(2000, 5, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if servo_is_stable(2000, 5, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
