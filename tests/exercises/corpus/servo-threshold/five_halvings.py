# mistake: five halvings of 49 ms leave 1.5 ms; the loop has to go on until the interval is 0.5 ms wide
# status: incorrect
# told: Your brackets hold the limit but are too wide: go on halving until they are no wider
import mujoco


def run_ok(model, integrator, dt):
    model.opt.integrator, model.opt.timestep = integrator, dt
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for i in range(round(3.0 / dt)):
        mujoco.mj_step(model, data)
    bad = sum(data.warning[w].number for w in (mujoco.mjtWarning.mjWARN_BADQPOS,
                                               mujoco.mjtWarning.mjWARN_BADQVEL,
                                               mujoco.mjtWarning.mjWARN_BADQACC))
    return bad == 0


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.050
    if run_ok(model, integrator, high):
        return None
    for _ in range(5):  # bisection
        middle = low + (high - low) / 2
        if run_ok(model, integrator, middle):
            low = middle
        else:
            high = middle
    return low, high
