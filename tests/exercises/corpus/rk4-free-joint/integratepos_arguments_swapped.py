# mistake: The last two arguments of mj_integratePos are swapped: the velocity comes before the time.
# next: Call mj_integratePos(model, qpos, velocity, h).
# status: crashed
# told: a free body on an off-centre spring, 250 steps of 2 ms: TypeError: mj_integratePos() was
import mujoco


def move(model, q, dt, v):
    out = q.copy()
    mujoco.mj_integratePos(model, out, dt, v)
    return out


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    ks = []
    for c in (0, h / 2, h / 2, h):
        if ks:
            data.qpos[:] = move(model, q, c, ks[-1][0])
            data.qvel[:] = v + c * ks[-1][1]
            data.act[:] = act + c * ks[-1][2]
            data.time = t + c
        mujoco.mj_forward(model, data)
        ks.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    m = [sum(w * k[i] for w, k in zip((1, 2, 2, 1), ks)) / 6 for i in range(3)]
    data.qpos[:] = move(model, q, h, m[0])
    data.qvel[:] = v + h * m[1]
    data.act[:] = act + h * m[2]
    data.time = t + h
