# mistake: Where nothing is unstable it returns (0.05, None) instead of None.
# next: Return None alone.
# status: partial
# told: Your function returns a tuple that holds None
import mujoco
def stable(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for i in range(int(3/h)):
        mujoco.mj_step(model, data)
        if max(w.number for w in data.warning) > 0:
            return False
    return True
def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    h_stable, h_unstable = 0.001, None
    h = 0.05
    while h_unstable is None or h_unstable - h_stable > 0.0005:
        if stable(model, h):
            h_stable = h
            if h == 0.05:
                break
        else:
            h_unstable = h
        h = (h_stable + h_unstable) / 2
    return h_stable, h_unstable
