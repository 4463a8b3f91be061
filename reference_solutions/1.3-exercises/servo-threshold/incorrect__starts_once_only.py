# diagnosis: Only your first run
import mujoco
def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    lo, hi = .001, .05
    def bad(h):
        model.opt.timestep = h
        for i in range(int(3/h)):
            mujoco.mj_step(model, data)
            if data.warning[6].number or data.warning[5].number or data.warning[4].number: 
                mujoco.mj_resetData(model, data)
                return True
        mujoco.mj_resetData(model, data)
        return False
    if not bad(hi): return None
    while hi-lo > 5e-4:
        m=(lo+hi)/2
        if bad(m): hi=m
        else: lo=m
    return lo, hi
