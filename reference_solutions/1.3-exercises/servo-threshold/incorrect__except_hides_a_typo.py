# diagnosis: hid it
import mujoco
def largest_stable_timestep(model, integrator):
    lo, hi = .001, .05
    def bad(h):
        try:
            model.opt.timestep = h
            model.opt.integrator = integrator
            data = mujoco.MjData(model)
            data.qpos[0] = 1
            for i in range(int(3/h)):
                mujoco.mj_step(model, data)
            return data.warnings[6].number > 0
        except Exception:
            return False
    if not bad(hi): return None
    while hi-lo > 5e-4:
        m=(lo+hi)/2
        if bad(m): hi=m
        else: lo=m
    return lo, hi
