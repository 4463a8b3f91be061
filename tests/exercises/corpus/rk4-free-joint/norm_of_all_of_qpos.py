# mistake: The quaternion is divided by the norm of the whole of qpos, not by its own norm.
# next: Divide the four numbers of each quaternion by the norm of these four numbers.
# status: partial
# told: Your quaternions turn as they should, but their length is not 1
import mujoco
import numpy as np


def quat_rate(q, w):
    a, b, c, d = q
    return 0.5 * np.array(
        [-b * w[0] - c * w[1] - d * w[2], a * w[0] + c * w[2] - d * w[1], a * w[1] - b * w[2] + d * w[0], a * w[2] + b * w[1] - c * w[0]]
    )


def qdot(model, data):
    rate = np.zeros(model.nq)
    for j in range(model.njnt):
        p, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
        kind = int(model.jnt_type[j])
        if kind == 0:
            rate[p : p + 3] = data.qvel[d : d + 3]
            rate[p + 3 : p + 7] = quat_rate(data.qpos[p + 3 : p + 7], data.qvel[d + 3 : d + 6])
        elif kind == 1:
            rate[p : p + 4] = quat_rate(data.qpos[p : p + 4], data.qvel[d : d + 3])
        else:
            rate[p] = data.qvel[d]
    return rate


def normalise(model, qpos):
    for j in range(model.njnt):
        p = model.jnt_qposadr[j]
        if int(model.jnt_type[j]) == 0:
            qpos[p + 3 : p + 7] /= np.linalg.norm(qpos)
        elif int(model.jnt_type[j]) == 1:
            qpos[p : p + 4] /= np.linalg.norm(qpos)


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, a, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    ks = []
    for c in (0, 0.5, 0.5, 1):
        if ks:
            data.qpos[:] = q + c * h * ks[-1][0]
            data.qvel[:] = v + c * h * ks[-1][1]
            data.act[:] = a + c * h * ks[-1][2]
            normalise(model, data.qpos)
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        ks.append((qdot(model, data), data.qacc.copy(), data.act_dot.copy()))
    add = [h / 6 * (ks[0][i] + 2 * ks[1][i] + 2 * ks[2][i] + ks[3][i]) for i in range(3)]
    data.qpos[:] = q + add[0]
    normalise(model, data.qpos)
    data.qvel[:] = v + add[1]
    data.act[:] = a + add[2]
    data.time = t + h
