# mistake: The run lasts half a second instead of 3 s, so slow growth is not seen.
# next: Simulate 3 s.
# status: incorrect
# told: Your runs are too short: 0.5 s, 23 steps at 21.53 ms, where a slow divergence does not
import mujoco

def ok(model, integrator, h, T=0.5):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    n = int(T / h)
    for i in range(n):
        mujoco.mj_step(model, data)
        for w in data.warning:
            if w.number: return False
    return True

def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.050
    if ok(model, integrator, hi):
        return None
    for _ in range(10):
        mid = (lo + hi)/2
        if ok(model, integrator, mid): lo = mid
        else: hi = mid
    return lo, hi
