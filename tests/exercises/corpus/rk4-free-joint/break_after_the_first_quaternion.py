# mistake: `break` ends the loop over the joints after the first one with a quaternion, so the joints behind it never move.
# next: Drop the break.
# status: partial
# told: Joints behind the first one with a quaternion never move
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco
import numpy as np


def advance(model, q, v, h):
    q = q.copy()
    for j in range(model.njnt):
        a, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE:
            q[a : a + 3] += h * v[d : d + 3]
            mujoco.mju_quatIntegrate(q[a + 3 : a + 7], v[d + 3 : d + 6], h)
            break
        elif model.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
            mujoco.mju_quatIntegrate(q[a : a + 4], v[d : d + 3], h)
            break
        q[a] += h * v[d]
    return q


def rk4_step(model, data):
    h = model.opt.timestep
    s0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    ks = []
    for c in (0, h / 2, h / 2, h):
        if ks:
            kv, ka, kw = ks[-1]
            data.qpos[:] = advance(model, s0[0], kv, c)
            data.qvel[:] = s0[1] + c * ka
            data.act[:] = s0[2] + c * kw
            data.time = s0[3] + c
        mujoco.mj_forward(model, data)
        ks.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    kv, ka, kw = (np.tensordot([1 / 6, 1 / 3, 1 / 3, 1 / 6], np.array(x), 1) for x in zip(*ks))
    data.qpos[:] = advance(model, s0[0], kv, h)
    data.qvel[:] = s0[1] + h * ka
    data.act[:] = s0[2] + h * kw
    data.time = s0[3] + h
