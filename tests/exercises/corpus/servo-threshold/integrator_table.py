# mistake: the int is looked up in a table of its own (0, 1, 2); 3 and 4 are not in it and fall back to Euler. Use the int as it is
# status: partial
# told: Your runs used Euler where another integrator was asked for. Set
import mujoco

TABLE = {
    0: mujoco.mjtIntegrator.mjINT_EULER,
    1: mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    2: mujoco.mjtIntegrator.mjINT_DISCRETE,
}


def stable(model, integrator, h):
    model.opt.integrator = TABLE.get(integrator, mujoco.mjtIntegrator.mjINT_EULER)
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    a, b = 0.001, 0.05
    if stable(model, integrator, b):
        return None
    while b - a > 0.0005:
        m = (a + b) / 2
        a, b = (m, b) if stable(model, integrator, m) else (a, m)
    return a, b
