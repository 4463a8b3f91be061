# mistake: acc() gives back data.qacc itself, a view: the sums, of the positions too, hold the last acceleration alone.
# next: Return data.qacc.copy().
# status: incorrect
# told: All accelerations equal the last one: data.qacc is a view that the next mj_forward
import mujoco


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q, v = data.qpos.copy(), data.qvel.copy()

    def acc(q, v, t):
        data.qpos[:], data.qvel[:], data.time = q, v, t
        mujoco.mj_forward(model, data)
        return data.qacc

    k1 = acc(q, v, t)
    k2 = acc(q + h / 2 * v, v + h / 2 * k1, t + h / 2)
    k3 = acc(q + h / 2 * (v + h / 2 * k1), v + h / 2 * k2, t + h / 2)
    k4 = acc(q + h * (v + h / 2 * k2), v + h * k3, t + h)
    data.qpos[:] = q + h * v + h * h / 6 * (k1 + k2 + k3)
    data.qvel[:] = v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    data.time = t + h
