# mistake: slope() gives back data.qvel itself, a view: all four position slopes become whatever qvel is last; copy it
# status: incorrect
# told: All stage velocities equal the last one: data.qvel is a view that the next stage
import mujoco


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q, v, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def slope(dq, dv, da, dt):
        data.qpos[:] = q + dq
        data.qvel[:] = v + dv
        data.act[:] = act + da
        data.time = t + dt
        mujoco.mj_forward(model, data)
        return data.qvel, data.qacc.copy(), data.act_dot.copy()

    k1 = slope(0, 0, 0, 0)
    k2 = slope(*[h / 2 * k for k in k1], h / 2)
    k3 = slope(*[h / 2 * k for k in k2], h / 2)
    k4 = slope(*[h * k for k in k3], h)

    mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)]
    data.qpos[:] = q + h * mean[0]
    data.qvel[:] = v + h * mean[1]
    data.act[:] = act + h * mean[2]
    data.time = t + h
