# mistake: Hinges are left out: only free and ball joints are moved.
# next: Move hinges and slides too.
# status: partial
# told: The position of a hinge or slide never changes, although its velocity does: move those as
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import math
import mujoco
import numpy as np

def qmul(a, b):
    w1, x1, y1, z1 = a
    w2, x2, y2, z2 = b
    return np.array([w1*w2 - x1*x2 - y1*y2 - z1*z2,
                     w1*x2 + x1*w2 + y1*z2 - z1*y2,
                     w1*y2 - x1*z2 + y1*w2 + z1*x2,
                     w1*z2 + x1*y2 - y1*x2 + z1*w2])

def rot(w, h):
    n = np.linalg.norm(w)
    if n < 1e-14:
        return np.array([1.0, 0, 0, 0])
    half = n * h / 2
    return np.concatenate([[math.cos(half)], math.sin(half) * w / n])

def move(model, q, v, h):
    q = q.copy()
    for j in range(model.njnt):
        p = model.jnt_qposadr[j]
        d = model.jnt_dofadr[j]
        kind = int(model.jnt_type[j])
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            q[p:p+3] += h * v[d:d+3]
            p += 3
            d += 3
        if kind in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL):
            q[p:p+4] = qmul(q[p:p+4], rot(v[d:d+3], h))
            q[p:p+4] /= np.linalg.norm(q[p:p+4])
    return q

def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    V, A, D = [], [], []
    for c in [0, 0.5, 0.5, 1]:
        if V:
            data.qpos[:] = move(model, q, V[-1], c*h)
            data.qvel[:] = v + c*h*A[-1]
            data.act[:] = act + c*h*D[-1]
        data.time = t + c*h
        mujoco.mj_forward(model, data)
        V.append(data.qvel.copy())
        A.append(data.qacc.copy())
        D.append(data.act_dot.copy())
    b = [1/6, 1/3, 1/3, 1/6]
    data.qpos[:] = move(model, q, sum(w*x for w, x in zip(b, V)), h)
    data.qvel[:] = v + h*sum(w*x for w, x in zip(b, A))
    data.act[:] = act + h*sum(w*x for w, x in zip(b, D))
    data.time = t + h
