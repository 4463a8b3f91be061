# mistake: Accelerations are solved from the mass matrix by hand, and springs, dampers and constraints (qfrc_passive, qfrc_constraint) are left out.
# next: Read data.qacc.
# status: incorrect
# told: the accelerations did not come from data.qacc, as mujoco.mj_forward leaves it
import mujoco
import numpy as np


def dynamics(model, data, q, v, act, t):
    """M(q) a = tau - bias."""
    data.qpos[:], data.qvel[:], data.act[:] = q, v, act
    data.time = t
    mujoco.mj_forward(model, data)
    force = data.qfrc_actuator + data.qfrc_applied - data.qfrc_bias
    a = np.zeros((1, model.nv))
    mujoco.mj_solveM(model, data, a, force[None])
    return v.copy(), a[0], data.act_dot.copy()


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    k1 = dynamics(model, data, q, v, act, t)
    k2 = dynamics(model, data, *(x + h / 2 * k for x, k in zip((q, v, act), k1)), t + h / 2)
    k3 = dynamics(model, data, *(x + h / 2 * k for x, k in zip((q, v, act), k2)), t + h / 2)
    k4 = dynamics(model, data, *(x + h * k for x, k in zip((q, v, act), k3)), t + h)
    out = [x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q, v, act), k1, k2, k3, k4)]
    data.qpos[:], data.qvel[:], data.act[:] = out
    data.time = t + h
