# mistake: The lists of stable and unstable timesteps are globals that keep what earlier calls found, for other models and integrators.
# next: Make the lists new in every call.
# status: partial
# told: Your answer holds a timestep that only an earlier call found unstable: in this call
import mujoco

stable_ones = []
unstable_ones = []


def try_out(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    for _ in range(int(3 / h)):
        mujoco.mj_step(model, data)
    if any(w.number for w in data.warning):
        unstable_ones.append(h)
    else:
        stable_ones.append(h)


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    try_out(model, lo)
    try_out(model, hi)
    if not unstable_ones:
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        try_out(model, mid)
        if mid in unstable_ones:
            hi = mid
        else:
            lo = mid
    return max(stable_ones), min(unstable_ones)
