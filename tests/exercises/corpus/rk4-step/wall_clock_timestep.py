# mistake: The step is as long as the wall-clock time since the last call, as in a game loop, not model.opt.timestep.
# next: Use h = model.opt.timestep.
# status: incorrect
# told: not the time that has passed on a clock
import time

import mujoco

last = time.perf_counter()


def rk4_step(model, data):
    global last
    now = time.perf_counter()
    dt, last = now - last, now
    t = data.time
    q, v, w = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def update(s, kq, kv, kw):
        data.qpos[:] = q + s * kq
        data.qvel[:] = v + s * kv
        data.act[:] = w + s * kw
        data.time = t + s

    def forward():
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = forward()
    update(dt / 2, *k1)
    k2 = forward()
    update(dt / 2, *k2)
    k3 = forward()
    update(dt, *k3)
    k4 = forward()
    update(dt / 6, *(a + 2 * b + 2 * c + d for a, b, c, d in zip(k1, k2, k3, k4)))
    data.time = t + dt
