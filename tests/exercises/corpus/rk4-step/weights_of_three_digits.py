# mistake: The weights 1/6 and 1/3 are typed as 0.167 and 0.333.
# next: Write 1/6 and 1/3 as fractions.
# status: incorrect
# told: which is 1/6 and 1/3 rounded
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, t, w = data.qpos.copy(), data.qvel.copy(), data.time, data.act.copy()
    kq, kv, kw = [], [], []
    for c in (0.0, 0.5, 0.5, 1.0):
        if kq:
            data.qpos[:] = q + c * h * kq[-1]
            data.qvel[:] = v + c * h * kv[-1]
            data.act[:] = w + c * h * kw[-1]
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        kq.append(data.qvel.copy())
        kv.append(data.qacc.copy())
        kw.append(data.act_dot.copy())
    b = (0.167, 0.333, 0.333, 0.167)
    data.qpos[:] = q + h * sum(bi * k for bi, k in zip(b, kq))
    data.qvel[:] = v + h * sum(bi * k for bi, k in zip(b, kv))
    data.act[:] = w + h * sum(bi * k for bi, k in zip(b, kw))
    data.time = t + h
