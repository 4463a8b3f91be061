# mistake: The half is missing in the derivative of the quaternion.
# next: Write quat * (0, omega) / 2.
# status: incorrect
# told: The quaternion turns twice as fast as it should
import mujoco
import numpy as np
def qdot(model, q, v):
    out = np.zeros(model.nq)
    for j in range(model.njnt):
        p, d, k = model.jnt_qposadr[j], model.jnt_dofadr[j], model.jnt_type[j]
        if k == 0:
            out[p:p+3] = v[d:d+3]; p += 3; d += 3
        if k <= 1:
            r = np.zeros(4)
            mujoco.mju_mulQuat(r, q[p:p+4], np.concatenate([[0], v[d:d+3]]))
            out[p:p+4] = r
        else:
            out[p] = v[d]
    return out
def norm(model, q):
    q = q.copy(); mujoco.mj_normalizeQuat(model, q); return q
def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    y = [data.qpos.copy(), data.qvel.copy(), data.act.copy()]
    def f(s, c):
        data.qpos[:] = norm(model, s[0]); data.qvel[:] = s[1]; data.act[:] = s[2]; data.time = t + c
        mujoco.mj_forward(model, data)
        return [qdot(model, s[0], s[1]), data.qacc.copy(), data.act_dot.copy()]
    go = lambda k, c: [a + c * b for a, b in zip(y, k)]
    k1 = f(y, 0); k2 = f(go(k1, h/2), h/2); k3 = f(go(k2, h/2), h/2); k4 = f(go(k3, h), h)
    end = go([(a + 2*b + 2*c + d)/6 for a, b, c, d in zip(k1, k2, k3, k4)], h)
    data.qpos[:] = norm(model, end[0]); data.qvel[:] = end[1]; data.act[:] = end[2]; data.time = t + h
