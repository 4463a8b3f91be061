# mistake: It looks whether the angle has settled near 0 late in the run, but after a warning MuJoCo has reset the state to rest at 0, so unstable runs look settled.
# next: Read data.warning[...].number, or watch for data.time running backwards, instead of the angle.
# status: incorrect
# told: At 50 ms MuJoCo raised BADQACC and reset the state, and your answer calls that timestep
import mujoco


def settles(model, h):
    model.opt.timestep = h
    d = mujoco.MjData(model)
    d.qpos[0] = 1.0
    peak = 0
    for k in range(round(3 / h)):
        mujoco.mj_step(model, d)
        if k * h > 0.5:
            peak = max(peak, abs(d.qpos[0]))
    return peak < 0.01


def largest_stable_timestep(model, integrator):
    model.opt.integrator = int(integrator)
    lo, hi = 0.001, 0.050
    if settles(model, hi):
        return None
    while hi - lo > 0.0005:
        mid = (hi + lo) / 2
        if settles(model, mid):
            lo = mid
        else:
            hi = mid
    return (lo, hi)
