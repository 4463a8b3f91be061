# mistake: the stage velocities handed to mj_integratePos are already multiplied by the time step, and it multiplies by h again
# status: incorrect
# told: The position of your stage 2 moves by h twice: a stage moves by a fraction of h,
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def moved(shift, dt):
        p = q.copy()
        mujoco.mj_integratePos(model, p, dt * shift, dt)
        return p

    def slope(position, velocity, activation, time):
        data.qpos[:], data.qvel[:], data.act[:], data.time = position, velocity, activation, time
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = slope(q, v, act, t)
    k2 = slope(moved(k1[0], h / 2), v + h / 2 * k1[1], act + h / 2 * k1[2], t + h / 2)
    k3 = slope(moved(k2[0], h / 2), v + h / 2 * k2[1], act + h / 2 * k2[2], t + h / 2)
    k4 = slope(moved(k3[0], h), v + h * k3[1], act + h * k3[2], t + h)

    data.qpos[:] = q
    mujoco.mj_integratePos(model, data.qpos, (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]) / 6, h)
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = act + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t + h
