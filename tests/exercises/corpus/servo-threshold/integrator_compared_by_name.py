# mistake: The integrator is compared with strings although it is an int, so no branch applies and the default stays.
# next: Set model.opt.integrator = integrator directly.
# status: partial
# told: Your runs used Euler where another integrator was asked
import mujoco

INTEGRATORS = {"Euler": 0, "RK4": 1, "implicit": 2, "implicitfast": 3, "discrete": 4}


def set_integrator(model, name):
    model.opt.integrator = INTEGRATORS.get(name, 0)


def servo_is_stable(model, integrator, timestep, seconds=3.0):
    set_integrator(model, integrator)
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(seconds / timestep)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if servo_is_stable(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if servo_is_stable(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
