# mistake: The angular velocity of a free joint is read from the first three of its velocities; they are the linear velocity.
# next: Read the linear velocity from the first three, the angular velocity from the last three.
# status: partial
# told: The place of a free joint moves by its angular velocity: of its six numbers in
# told from MuJoCo 4.0.0: incorrect: The place of a free joint moves by its angular velocity
import mujoco
import numpy as np


def add(model, q, u, dt):
    result = q.copy()
    for j in range(model.njnt):
        a, b = model.jnt_qposadr[j], model.jnt_dofadr[j]
        if model.jnt_type[j] == 0:
            w, v = u[b : b + 3], u[b + 3 : b + 6]
            result[a : a + 3] += dt * v
            quat = result[a + 3 : a + 7].copy()
            mujoco.mju_quatIntegrate(quat, w, dt)
            result[a + 3 : a + 7] = quat
        elif model.jnt_type[j] == 1:
            quat = result[a : a + 4].copy()
            mujoco.mju_quatIntegrate(quat, u[b : b + 3], dt)
            result[a : a + 4] = quat
        else:
            result[a] += dt * u[b]
    return result


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, z, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    us, accs, zs = [], [], []
    for c in (0.0, h / 2, h / 2, h):
        if us:
            data.qpos[:] = add(model, q, us[-1], c)
            data.qvel[:] = v + c * accs[-1]
            data.act[:] = z + c * zs[-1]
        data.time = t + c
        mujoco.mj_forward(model, data)
        us.append(data.qvel.copy())
        accs.append(data.qacc.copy())
        zs.append(data.act_dot.copy())
    w = np.array([1, 2, 2, 1]) / 6
    data.qpos[:] = add(model, q, w @ us, h)
    data.qvel[:] = v + h * (w @ accs)
    data.act[:] = z + h * (w @ np.array(zs).reshape(4, -1))
    data.time = t + h
