# diagnosis: In a hidden case your step changes nothing
# from MuJoCo 4.0.0: incorrect: of second order on rotations only
"""Returns at once where the model is not a single free body."""
import mujoco


def mean(k):
    return (k[0] + 2 * k[1] + 2 * k[2] + k[3]) / 6


def rk4_step(model, data):
    if model.nq != 7:
        return
    h, t0 = model.opt.timestep, data.time
    q0, v0, act0 = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    vs, accs, rates = [], [], []
    for fraction in (0, 0.5, 0.5, 1):
        data.qpos[:], data.qvel[:], data.act[:] = q0, v0, act0
        if vs:
            mujoco.mj_integratePos(model, data.qpos, vs[-1], fraction * h)
            data.qvel[:] = v0 + fraction * h * accs[-1]
            data.act[:] = act0 + fraction * h * rates[-1]
        data.time = t0 + fraction * h
        mujoco.mj_forward(model, data)
        vs.append(data.qvel.copy())
        accs.append(data.qacc.copy())
        rates.append(data.act_dot.copy())
    data.qpos[:] = q0
    mujoco.mj_integratePos(model, data.qpos, mean(vs), h)
    data.qvel[:] = v0 + h * mean(accs)
    data.act[:] = act0 + h * mean(rates)
    data.time = t0 + h
