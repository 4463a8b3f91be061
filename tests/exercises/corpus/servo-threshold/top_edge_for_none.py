# mistake: The bisection never runs at 50 ms, so where nothing is unstable it ends at the upper edge and returns that as a bracket.
# next: Run 50 ms first and return None if it is stable.
# status: partial
# told: and none of your runs was unstable. Run 50 ms first, and return None
import mujoco


def ok(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    d = mujoco.MjData(model)
    d.qpos[0] = 1.0
    while d.time < 3.0:
        t = d.time
        mujoco.mj_step(model, d)
        if d.time <= t:
            return False
    return True


def largest_stable_timestep(model, integrator):
    good, bad = 0.001, 0.05
    while bad - good > 0.0003:
        h = (good + bad) * 0.5
        if ok(model, integrator, h):
            good = h
        else:
            bad = h
    return good, bad
