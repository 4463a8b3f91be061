# mistake: SciPy's Rotation keeps w last; the quaternion is reordered on the way in but not on the way out.
# next: Put w first again before writing it into qpos.
# status: incorrect
# told: come back into data.qpos as (x, y, z, w)
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation


def turn(quat, w, h):
    r = Rotation.from_quat(np.roll(quat, -1))
    return (r * Rotation.from_rotvec(w * h)).as_quat()


def move(model, q, v, h):
    out = q.copy()
    for j in range(model.njnt):
        a, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
        kind = model.jnt_type[j]
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            out[a : a + 3] += h * v[d : d + 3]
            out[a + 3 : a + 7] = turn(q[a + 3 : a + 7], v[d + 3 : d + 6], h)
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            out[a : a + 4] = turn(q[a : a + 4], v[d : d + 3], h)
        else:
            out[a] += h * v[d]
    return out


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def f(c, k):
        if k:
            data.qpos[:] = move(model, q, k[0], c)
            data.qvel[:] = v + c * k[1]
            data.act[:] = w + c * k[2]
            data.time = t + c
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = f(0, None)
    k2 = f(h / 2, k1)
    k3 = f(h / 2, k2)
    k4 = f(h, k3)
    s = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)]
    data.qpos[:] = move(model, q, s[0], h)
    data.qvel[:] = v + h * s[1]
    data.act[:] = w + h * s[2]
    data.time = t + h
