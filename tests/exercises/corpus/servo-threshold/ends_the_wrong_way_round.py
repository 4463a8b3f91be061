# mistake: The bracket is returned with the unstable end first.
# next: Return (h_stable, h_unstable).
# status: incorrect
# told: The ends of your brackets are in the wrong order:
import mujoco


def diverges(model, h):
    model.opt.timestep = h
    d = mujoco.MjData(model)
    d.qpos[0] = 1.0
    t = 0.0
    while True:
        mujoco.mj_step(model, d)
        if d.time < t:      # reset happened
            return True
        t = d.time
        if t >= 3.0:
            return False


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    good = 0.001
    bad = 0.05
    if not diverges(model, bad):
        return None
    while bad - good > 5e-4:
        m = (good + bad) / 2
        if diverges(model, m):
            bad = m
        else:
            good = m
    return bad, good
