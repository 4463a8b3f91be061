# mistake: The accelerations come from the equations of motion of the lesson's double pendulum, so other models and forces go wrong.
# next: Take accelerations from mj_forward for the model that is given.
# status: incorrect
# told: mj_forward is called once, when your step has ended
"""double pendulum with point masses, link lengths 0.3 m (see lesson)"""
import mujoco
import numpy as np

M1 = M2 = 1.0
L1 = L2 = 0.3
G = 9.81


def qacc(q, qd):
    # q[1] is relative to the first link, so go to absolute angles
    th1, th2 = q[0], q[0] + q[1]
    w1, w2 = qd[0], qd[0] + qd[1]
    d = th1 - th2
    A = np.array([[(M1 + M2) * L1, M2 * L2 * np.cos(d)], [L1 * np.cos(d), L2]])
    rhs = np.array([
        -M2 * L2 * w2**2 * np.sin(d) - (M1 + M2) * G * np.sin(th1),
        L1 * w1**2 * np.sin(d) - G * np.sin(th2),
    ])
    al1, al2 = np.linalg.solve(A, rhs)
    return np.array([al1, al2 - al1])


def rk4_step(model, data):
    h = model.opt.timestep
    q, v = data.qpos.copy(), data.qvel.copy()
    k1q, k1v = v, qacc(q, v)
    k2q, k2v = v + h / 2 * k1v, qacc(q + h / 2 * k1q, v + h / 2 * k1v)
    k3q, k3v = v + h / 2 * k2v, qacc(q + h / 2 * k2q, v + h / 2 * k2v)
    k4q, k4v = v + h * k3v, qacc(q + h * k3q, v + h * k3v)
    data.qpos[:] = q + h / 6 * (k1q + 2 * k2q + 2 * k3q + k4q)
    data.qvel[:] = v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
    data.time += h
    mujoco.mj_forward(model, data)
