# diagnosis: data.act does not change
# from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco


def mean(k):
    return (k[0] + 2 * k[1] + 2 * k[2] + k[3]) / 6


def rk4_step(model, data):
    h, t0 = model.opt.timestep, data.time
    q0, v0 = data.qpos.copy(), data.qvel.copy()
    vs, accs = [], []
    for fraction in (0, 0.5, 0.5, 1):
        data.qpos[:], data.qvel[:] = q0, v0
        if vs:
            mujoco.mj_integratePos(model, data.qpos, vs[-1], fraction * h)
            data.qvel[:] = v0 + fraction * h * accs[-1]
        data.time = t0 + fraction * h
        mujoco.mj_forward(model, data)
        vs.append(data.qvel.copy())
        accs.append(data.qacc.copy())
    data.qpos[:] = q0
    mujoco.mj_integratePos(model, data.qpos, mean(vs), h)
    data.qvel[:] = v0 + h * mean(accs)
    data.time = t0 + h
