# mistake: Every run has 100 steps whatever the timestep, so a small timestep is watched for a fraction of the 3 s.
# next: Take round(3 / h) steps.
# status: partial
# told: Your runs are too short: 1.3 s, where a slow divergence does not show
import mujoco

N_STEPS = 100


def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(N_STEPS):
        mujoco.mj_step(model, data)
    # note: counter becomes nonzero as soon as there was one bad step
    return (data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number == 0
            and data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number == 0)


def largest_stable_timestep(model, integrator):
    low, high = 0.001, 0.05
    if is_stable(model, integrator, high):
        return None
    while high - low > 0.0005:
        middle = (low + high) / 2
        if is_stable(model, integrator, middle):
            low = middle
        else:
            high = middle
    return low, high
