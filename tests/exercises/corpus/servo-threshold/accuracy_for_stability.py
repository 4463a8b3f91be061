# mistake: A timestep counts as unstable as soon as its run differs by 5 % from a run at 0.1 ms.
# next: Look for a warning, not for a difference from a finer run.
# status: incorrect
# told: your run raised no warning within 3 s, and you call it unstable
import mujoco


def final_angle(model, integrator, h, seconds=3.0):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    trace = []
    while data.time < seconds:
        mujoco.mj_step(model, data)
        trace.append((data.time, data.qpos[0]))
    return trace


def close(model, integrator, h, reference):
    mine = dict((round(t, 4), q) for t, q in final_angle(model, integrator, h))
    worst = 0
    for t, q in reference:
        if round(t, 4) in mine:
            worst = max(worst, abs(q - mine[round(t, 4)]))
    return worst < 0.05


def largest_stable_timestep(model, integrator):
    reference = final_angle(model, integrator, 0.0005)
    lo, hi = 0.001, 0.05
    if close(model, integrator, hi, reference):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if close(model, integrator, mid, reference):
            lo = mid
        else:
            hi = mid
    return lo, hi
