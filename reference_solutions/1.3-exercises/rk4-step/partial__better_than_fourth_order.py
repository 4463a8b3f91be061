# diagnosis: This method takes six slopes and is of fifth order or more
import mujoco

# Dormand and Prince's method, as in scipy's RK45
A = [
    [],
    [1 / 5],
    [3 / 40, 9 / 40],
    [44 / 45, -56 / 15, 32 / 9],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
]
B = [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]


def rk4_step(model, data):
    h, t, q, v, act = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()
    ks = []
    for row in A:
        data.qpos[:] = q + h * sum(a * k[0] for a, k in zip(row, ks))
        data.qvel[:] = v + h * sum(a * k[1] for a, k in zip(row, ks))
        data.act[:] = act + h * sum(a * k[2] for a, k in zip(row, ks))
        data.time = t + h * sum(row)
        mujoco.mj_forward(model, data)
        ks.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    data.qpos[:] = q + h * sum(b * k[0] for b, k in zip(B, ks))
    data.qvel[:] = v + h * sum(b * k[1] for b, k in zip(B, ks))
    data.act[:] = act + h * sum(b * k[2] for b, k in zip(B, ks))
    data.time = t + h
