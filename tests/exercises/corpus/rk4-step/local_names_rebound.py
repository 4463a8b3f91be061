# mistake: The result is bound to local names instead of being written into data, so data stays at the fourth stage.
# next: Assign with data.qpos[:] = ..., not to a variable that once was data.qpos.
# status: incorrect
# told: After your step data stands at your last stage: the weighted sum
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    qpos, qvel, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    kq, kv, ka = [], [], []
    for frac in [0, 0.5, 0.5, 1]:
        if kq:
            data.qpos[:] = qpos + frac * h * kq[-1]
            data.qvel[:] = qvel + frac * h * kv[-1]
            data.act[:] = act + frac * h * ka[-1]
        data.time = t + frac * h
        mujoco.mj_forward(model, data)
        kq.append(data.qvel.copy())
        kv.append(data.qacc.copy())
        ka.append(data.act_dot.copy())
    qpos += h * (kq[0] + 2 * kq[1] + 2 * kq[2] + kq[3]) / 6
    qvel += h * (kv[0] + 2 * kv[1] + 2 * kv[2] + kv[3]) / 6
    act += h * (ka[0] + 2 * ka[1] + 2 * ka[2] + ka[3]) / 6
