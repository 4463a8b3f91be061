# diagnosis: never call mujoco.mj_resetData
import mujoco
def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    lo, hi = .001, .05
    def bad(h):
        model.opt.timestep = h
        data.qpos[0] = 1; data.qvel[0] = 0; data.time = 0
        for i in range(int(3/h)):
            mujoco.mj_step(model, data)
        return sum(w.number for w in data.warning) > 0
    if not bad(hi): return None
    while hi-lo > 5e-4:
        m=(lo+hi)/2
        if bad(m): hi=m
        else: lo=m
    return lo, hi
