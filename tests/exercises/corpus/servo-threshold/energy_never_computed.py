# mistake: It looks at data.energy, which stays zero because the energy flag of the model is not set.
# next: Set model.opt.enableflags |= mjENBL_ENERGY, or look at data.warning.
# status: incorrect
# told: At 50 ms MuJoCo raised BADQACC and reset the state, and your answer calls that
import mujoco


def gains_energy(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    mujoco.mj_forward(model, data)
    start = sum(data.energy)
    top = start
    for _ in range(int(3 / h)):
        mujoco.mj_step(model, data)
        top = max(top, sum(data.energy))
    return top > start + 1


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    good, bad = 0.001, 0.050
    if not gains_energy(model, bad):
        return None
    while bad - good > 0.0005:
        h = (good + bad) / 2
        good, bad = (good, h) if gains_energy(model, h) else (h, bad)
    return good, bad
