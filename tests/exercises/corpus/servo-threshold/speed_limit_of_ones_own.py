# mistake: A run counts as unstable as soon as the speed passes 20 rad/s, which a stiff servo reaches in its first swing.
# next: Count MuJoCo's warnings, not a speed chosen by yourself.
# status: incorrect
# told: At 1.383 ms your run raised no warning within 0.0028 s, where you ended it, and you call
import mujoco

MAX_SPEED = 20.0


def sane(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if abs(data.qvel[0]) > MAX_SPEED:
            return False
    return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if sane(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if sane(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
