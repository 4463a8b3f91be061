# mistake: The bracket is returned in milliseconds instead of seconds.
# next: Divide by 1000 before returning.
# status: incorrect
# told: You reported milliseconds, not seconds: divide by
import mujoco

W = mujoco.mjtWarning


def unstable(model, data, h_ms):
    model.opt.timestep = h_ms / 1000
    mujoco.mj_resetData(model, data)
    data.qpos[0] = 1
    steps = int(3000 / h_ms)
    for i in range(steps):
        mujoco.mj_step(model, data)
        if data.warning[W.mjWARN_BADQACC].number + data.warning[W.mjWARN_BADQVEL].number + data.warning[W.mjWARN_BADQPOS].number > 0:
            return True
    return False


def largest_stable_timestep(model, integrator):
    """bisection in ms"""
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    a, b = 1.0, 50.0
    if not unstable(model, data, b):
        return None
    while b - a > 0.5:
        c = (a + b) / 2
        if unstable(model, data, c):
            b = c
        else:
            a = c
    return a, b
