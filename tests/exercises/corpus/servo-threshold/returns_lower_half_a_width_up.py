# mistake: A right search, whose ends are returned times 0.9.
# next: Return the ends.
# status: incorrect
# told: 0.9 times what it found
import mujoco
def ok(model, integrator, h):
    model.opt.integrator = integrator; model.opt.timestep = h
    d = mujoco.MjData(model); d.qpos[0] = 1
    for _ in range(int(3 / h)):
        mujoco.mj_step(model, d)
        if d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number: return False
    return True
def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if ok(model, integrator, hi): return None
    while hi - lo > 0.0005:
        middle = (lo + hi) / 2
        if ok(model, integrator, middle): lo = middle
        else: hi = middle
    return lo * 0.9, hi * 0.9
