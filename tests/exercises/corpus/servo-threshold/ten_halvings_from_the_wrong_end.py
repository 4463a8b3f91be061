# mistake: The lower end moves after unstable runs as well.
# next: Put its line into the else.
# status: incorrect
# told: moves its lower end to the middle after unstable runs as well
import mujoco
def unstable(model, integrator, h):
    model.opt.integrator = integrator; model.opt.timestep = h
    d = mujoco.MjData(model); d.qpos[0] = 1
    for k in range(int(3.0 / h)):
        mujoco.mj_step(model, d)
        if d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number: return True
    return False
def largest_stable_timestep(model, integrator):
    if not unstable(model, integrator, 0.05): return None
    low, high = 0.001, 0.05
    for _ in range(4):
        mid = (low + high) / 2
        if unstable(model, integrator, mid):
            high = mid
        low = mid
    return low, high
