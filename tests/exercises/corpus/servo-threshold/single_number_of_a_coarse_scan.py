# mistake: A scan in steps of 5 ms returns its last stable timestep as a single number, which can be 5 ms below the limit.
# next: Bisect, and return both ends.
# status: partial
# told: Your search is too coarse: its last stable and its first unstable timestep
import mujoco

candidates = [0.001, 0.002, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04, 0.045, 0.05]


def run(model, integrator, h):
    model.opt.timestep = h
    model.opt.integrator = integrator
    d = mujoco.MjData(model)
    d.qpos[0] = 1
    while d.time < 3:
        before = d.time
        mujoco.mj_step(model, d)
        if d.time <= before:
            return False
    return True


def largest_stable_timestep(model, integrator):
    results = {h: run(model, integrator, h) for h in candidates}
    if all(results.values()):
        return None
    return max(h for h in candidates if results[h])
