# mistake: Slopes are cached by their time; stages 2 and 3 have the same time, so k3 is k2 again.
# next: Drop the cache: mj_forward must run for every stage.
# status: incorrect
# told: Your third stage is never evaluated: k2 is used in its place
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t0 = data.time
    q0 = data.qpos.copy()
    v0 = data.qvel.copy()
    w0 = data.act.copy()
    cache = {}

    def rhs(t, q, v, w):
        if t not in cache:
            data.time = t
            data.qpos[:] = q
            data.qvel[:] = v
            data.act[:] = w
            mujoco.mj_forward(model, data)
            cache[t] = (data.qvel.copy(), data.qacc.copy(), data.act_dot.copy())
        return cache[t]

    a = rhs(t0, q0, v0, w0)
    b = rhs(t0 + h / 2, q0 + h / 2 * a[0], v0 + h / 2 * a[1], w0 + h / 2 * a[2])
    c = rhs(t0 + h / 2, q0 + h / 2 * b[0], v0 + h / 2 * b[1], w0 + h / 2 * b[2])
    d = rhs(t0 + h, q0 + h * c[0], v0 + h * c[1], w0 + h * c[2])
    data.qpos[:] = q0 + h * (a[0] + 2 * b[0] + 2 * c[0] + d[0]) / 6
    data.qvel[:] = v0 + h * (a[1] + 2 * b[1] + 2 * c[1] + d[1]) / 6
    data.act[:] = w0 + h * (a[2] + 2 * b[2] + 2 * c[2] + d[2]) / 6
    data.time = t0 + h
