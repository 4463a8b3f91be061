# mistake: The servo's damping is set to zero before measuring, so the limit is that of the spring alone.
# next: Leave the gains of the model as they are.
# status: incorrect
# told: Your limits are those of a servo without its damping kv: keep the actuator's third bias
import mujoco


def largest_stable_timestep(model, integrator):
    # "Compare with the bound 2 sqrt(I/kp)": it has no damping, so switch it off
    model.actuator_biasprm[0, 2] = 0.0
    model.opt.integrator = integrator
    data = mujoco.MjData(model)

    def bad(h):
        model.opt.timestep = h
        mujoco.mj_resetData(model, data)
        data.qpos[0] = 1.0
        for _ in range(round(3 / h)):
            mujoco.mj_step(model, data)
            if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
                return True
        return False

    if not bad(0.05):
        return None
    lo, hi = 0.001, 0.05
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if bad(mid):
            hi = mid
        else:
            lo = mid
    return lo, hi
