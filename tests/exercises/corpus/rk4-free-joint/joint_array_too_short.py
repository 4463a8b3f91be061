# mistake: The joint of a velocity is looked up with the number of the velocity in an array that has one entry for each joint, so a list runs out.
# next: Loop over joints, and use model.jnt_qposadr and model.jnt_dofadr for their places.
# status: crashed
# told: IndexError: list index out of
import mujoco
import numpy as np


def joint_kind(model, dof):
    kinds = [int(x) for x in model.jnt_type]
    return kinds[dof]


def moved(model, q, v, dt):
    out = list(q)
    for dof in range(model.nv):
        if joint_kind(model, dof) >= 2:
            out[dof] += dt * v[dof]
    tmp = np.array(q)
    mujoco.mj_integratePos(model, tmp, v, dt)
    for j in range(model.njnt):
        if joint_kind(model, j) < 2:
            a = model.jnt_qposadr[j]
            n = 7 if joint_kind(model, j) == 0 else 4
            out[a:a + n] = tmp[a:a + n]
    return np.array(out)


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    k = []
    for c in (0, 0.5 * h, 0.5 * h, h):
        if k:
            data.qpos[:] = moved(model, q, k[-1][0], c)
            data.qvel[:] = v + c * k[-1][1]
            data.act[:] = w + c * k[-1][2]
        data.time = t + c
        mujoco.mj_forward(model, data)
        k.append([data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()])
    s = [(k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]) / 6 for i in range(3)]
    data.qpos[:] = moved(model, q, s[0], h)
    data.qvel[:] = v + h * s[1]
    data.act[:] = w + h * s[2]
    data.time = t + h
