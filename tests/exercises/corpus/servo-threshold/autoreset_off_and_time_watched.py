# mistake: Automatic resets are switched off, and the script waits for data.time to run backwards, which only a reset does.
# next: Leave resets on, or look at data.warning.
# status: incorrect
# told: You switched the automatic reset off, so that data.time never falls back
import mujoco


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    # keep the state where it explodes so that we can look at it
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)

    def diverges(h: float) -> bool:
        model.opt.timestep = h
        data = mujoco.MjData(model)
        data.qpos[0] = 1.0
        for _ in range(int(round(3.0 / h))):
            before = data.time
            mujoco.mj_step(model, data)
            if data.time < before:
                return True
        return False

    lo, hi = 0.001, 0.050
    if not diverges(hi):
        return None
    while hi - lo > 0.0005:
        mid = 0.5 * (lo + hi)
        lo, hi = (lo, mid) if diverges(mid) else (mid, hi)
    return lo, hi
