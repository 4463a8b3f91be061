# mistake: The recursive call's result is not returned, so the function gives None.
# next: Write return before the call of the function itself.
# status: incorrect
# told: Your search is right: 19.76 ms stayed stable, and at 20.14 ms MuJoCo warned; but your function
import mujoco

def stable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    d = mujoco.MjData(model)
    d.qpos[0] = 1
    for i in range(round(3 / h)):
        mujoco.mj_step(model, d)
    return d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 0

def largest_stable_timestep(model, integrator, lo=0.001, hi=0.05):
    if stable(model, integrator, 0.05):
        return None
    if hi - lo <= 0.0005:
        return lo, hi
    mid = (lo + hi) / 2
    if stable(model, integrator, mid):
        largest_stable_timestep(model, integrator, mid, hi)
    else:
        largest_stable_timestep(model, integrator, lo, mid)
