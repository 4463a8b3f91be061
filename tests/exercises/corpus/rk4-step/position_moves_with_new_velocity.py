# mistake: the last line moves the position by the velocity at the END of the step (as semi-implicit Euler), not by the mean of slopes
# status: incorrect
# told: The position advances with the new velocity alone; use the weighted mean of the four
import mujoco


def rk4_step(model, data):
    """Advance data by model.opt.timestep, with accelerations from mujoco.mj_forward alone."""
    h = model.opt.timestep
    t = data.time
    q, v, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def acceleration(position, velocity, activation, time):
        data.qpos[:], data.qvel[:], data.act[:] = position, velocity, activation
        data.time = time
        mujoco.mj_forward(model, data)
        return data.qacc.copy(), data.act_dot.copy()

    a1, d1 = acceleration(q, v, act, t)
    v2 = v + h / 2 * a1
    a2, d2 = acceleration(q + h / 2 * v, v2, act + h / 2 * d1, t + h / 2)
    v3 = v + h / 2 * a2
    a3, d3 = acceleration(q + h / 2 * v2, v3, act + h / 2 * d2, t + h / 2)
    v4 = v + h * a3
    a4, d4 = acceleration(q + h * v3, v4, act + h * d3, t + h)

    data.act[:] = act + h * (d1 + 2 * d2 + 2 * d3 + d4) / 6
    data.qvel[:] = v + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6
    data.qpos[:] = q + h * data.qvel
    data.time = t + h
