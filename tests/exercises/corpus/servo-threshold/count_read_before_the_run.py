# mistake: The number of warnings is read into a variable before the run, and this variable is looked at after it.
# next: Read data.warning[...].number after the steps.
# status: incorrect
# told: At 50 ms MuJoCo raised BADQACC and reset the state, and your answer calls that
import mujoco


def diverges(model, integrator, h):
    model.opt.timestep = h
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    bad_pos = data.warning[mujoco.mjtWarning.mjWARN_BADQPOS].number
    bad_vel = data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number
    bad_acc = data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number
    n = int(3.0 / h)
    mujoco.mj_step(model, data, n)
    return bad_pos + bad_vel + bad_acc > 0


def largest_stable_timestep(model, integrator):
    left, right = 0.001, 0.05
    if not diverges(model, integrator, right):
        return None
    for _ in range(20):
        mid = (left + right) / 2
        if diverges(model, integrator, mid):
            right = mid
        else:
            left = mid
    return left, right
