# mistake: The recursive bisection calls itself with the same bracket again, so it never ends.
# next: Call it with (low, mid) or (mid, high), and stop at a width of 0.5 ms.
# status: incorrect
# told: kp = 2000, kv = 5, Euler: RecursionError: maximum recursion depth exceeded, in line 9 of
import mujoco


def stable(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(0.3 / h)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def bisect(model, low, high):
    if high - low <= 0.0005:
        return low, high
    mid = (low + high) / 2
    if stable(model, mid):
        return bisect(model, mid, high)
    return bisect(model, low, high)


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    if stable(model, 0.05):
        return None
    return bisect(model, 0.001, 0.05)
