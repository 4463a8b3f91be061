# diagnosis: The quaternion of a ball joint never changes
import mujoco, numpy as np
from scipy.spatial.transform import Rotation as R
def move(model, q, v, h):
    q = q.copy()
    for j in range(model.njnt):
        a, d, kind = model.jnt_qposadr[j], model.jnt_dofadr[j], model.jnt_type[j]
        if kind >= 2:
            q[a] += h*v[d]; continue
        if kind == mujoco.mjtJoint.mjJNT_BALL: continue
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            q[a:a+3] += h*v[d:d+3]; a, d = a+3, d+3
        w, x, y, z = q[a:a+4]
        r = R.from_quat([x, y, z, w]) * R.from_rotvec(h*v[d:d+3])
        x, y, z, w = r.as_quat(); q[a:a+4] = w, x, y, z
    return q
def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q0, v0, a0 = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    def f(q, v, a, t):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, a, t
        mujoco.mj_forward(model, data); return v, data.qacc.copy(), data.act_dot.copy()
    k1 = f(q0, v0, a0, t)
    k2 = f(move(model, q0, k1[0], h/2), v0 + h/2*k1[1], a0 + h/2*k1[2], t + h/2)
    k3 = f(move(model, q0, k2[0], h/2), v0 + h/2*k2[1], a0 + h/2*k2[2], t + h/2)
    k4 = f(move(model, q0, k3[0], h), v0 + h*k3[1], a0 + h*k3[2], t + h)
    dv, acc, da = ((p + 2*q + 2*r + s)/6 for p, q, r, s in zip(k1, k2, k3, k4))
    data.qpos[:], data.qvel[:], data.act[:], data.time = move(model, q0, dv, h), v0 + h*acc, a0 + h*da, t + h
