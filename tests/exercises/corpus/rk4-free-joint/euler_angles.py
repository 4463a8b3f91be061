# mistake: The quaternion is turned into roll, pitch and yaw, and the angular velocity is added to them; it is not the rate of these angles.
# next: Turn the quaternion by the rotation vector h w, as mj_integratePos does.
# status: incorrect
# told: Your turns add h times the angular velocity to roll, pitch and yaw
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation as R


def add_rotation(quat, omega, h):
    rpy = R.from_quat([quat[1], quat[2], quat[3], quat[0]]).as_euler("xyz")
    x, y, z, w = R.from_euler("xyz", rpy + h * omega).as_quat()
    return [w, x, y, z]


def integrate(model, q, v, h):
    q = q.copy()
    for j in range(model.njnt):
        qa, va = model.jnt_qposadr[j], model.jnt_dofadr[j]
        t = model.jnt_type[j]
        if t == 0:
            q[qa : qa + 3] += h * v[va : va + 3]
            qa, va, t = qa + 3, va + 3, 1
        if t == 1:
            q[qa : qa + 4] = add_rotation(q[qa : qa + 4], v[va : va + 3], h)
        else:
            q[qa] += h * v[va]
    return q


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    ks = []
    for c in (0, 0.5, 0.5, 1):
        if ks:
            dv, da, dw = ks[-1]
            data.qpos[:] = integrate(model, q, dv, c * h)
            data.qvel[:] = v + c * h * da
            data.act[:] = w + c * h * dw
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        ks.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    dv, da, dw = (sum(b * k for b, k in zip((1 / 6, 1 / 3, 1 / 3, 1 / 6), row)) for row in zip(*ks))
    data.qpos[:] = integrate(model, q, dv, h)
    data.qvel[:] = v + h * da
    data.act[:] = w + h * dw
    data.time = t + h
