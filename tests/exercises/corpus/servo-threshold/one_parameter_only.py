# mistake: The function takes the model alone, although it is called with the model and the integrator.
# next: Write def largest_stable_timestep(model, integrator).
# status: crashed
# told: TypeError: largest_stable_timestep() takes 1 positional
import mujoco


def largest_stable_timestep(model):
    out = {}
    for integrator in (0, 3, 4):
        model.opt.integrator = integrator
        lo, hi = 0.001, 0.05
        while hi - lo > 0.0005:
            mid = (lo + hi) / 2
            model.opt.timestep = mid
            d = mujoco.MjData(model)
            d.qpos[0] = 1.0
            ok = True
            for _ in range(round(3 / mid)):
                mujoco.mj_step(model, d)
                if d.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
                    ok = False
                    break
            if ok:
                lo = mid
            else:
                hi = mid
        out[integrator] = (lo, hi)
    return out
