# mistake: data.qvel[0] is set to 1 instead of data.qpos[0], so the run starts at the target and moving.
# next: Set data.qpos[0] = 1.0 and leave the velocity at 0.
# status: partial
# told: Your runs start with hinge at 0 rad and a speed of 1 rad/s, not at 1 rad at
import mujoco


def ok(model, h):
    model.opt.timestep = h
    d = mujoco.MjData(model)
    d.qvel[0] = 1.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, d)
        if d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    if ok(model, hi):
        return None
    while hi - lo > 1e-5:
        mid = (lo + hi) / 2
        lo, hi = (mid, hi) if ok(model, mid) else (lo, mid)
    return lo, hi
