# mistake: The bisection stops after three halvings and the middle is returned, which can be 3 ms off.
# next: Halve until the ends are no further apart than 0.5 ms.
# status: partial
# told: Your search is too coarse: its last stable and its first unstable
import mujoco


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    for i in range(4):
        h = hi if i == 0 else (lo + hi) / 2
        model.opt.timestep = h
        data = mujoco.MjData(model)
        data.qpos[0] = 1.0
        for _ in range(round(3 / h)):
            mujoco.mj_step(model, data)
        # MuJoCo counts its warnings
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            hi = h
        elif i == 0:
            return None
        else:
            lo = h
    return (lo + hi) / 2
