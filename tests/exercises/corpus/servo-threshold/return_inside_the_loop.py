# mistake: `return True` stands inside the loop, so every run ends after its first step.
# next: Move `return True` out of the loop.
# status: incorrect
# told: Each of your runs ends after its first step: a return that stands inside the loop
import mujoco


def is_stable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    for _ in range(int(3 / h)):
        mujoco.mj_step(model, data)
        if any(w.number > 0 for w in data.warning):
            return False
        return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if is_stable(model, integrator, hi):
        return None
    while hi - lo > 0.0004:
        mid = (lo + hi) / 2
        if is_stable(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
