# mistake: This is the 3/8 rule, a different fourth-order method from the classical one that is asked for.
# next: Use the classical stages at 0, 1/2, 1/2, 1 with the weights 1, 2, 2, 1 over 6.
# status: partial
# told: This is Kutta's 3/8 rule: fourth order, but not the classical step that was asked
import mujoco
import numpy as np

# Butcher tableau (from wikipedia, "fourth-order")
A = np.array([[0, 0, 0, 0],
              [1 / 3, 0, 0, 0],
              [-1 / 3, 1, 0, 0],
              [1, -1, 1, 0]])
b = np.array([1 / 8, 3 / 8, 3 / 8, 1 / 8])
c = A.sum(axis=1)


def rk4_step(model, data):
    h = model.opt.timestep
    y0 = np.concatenate((data.qpos, data.qvel, data.act))
    t0 = data.time
    i, j = model.nq, model.nq + model.nv
    K = np.zeros((4, y0.size))
    for s in range(4):
        y = y0 + h * A[s] @ K
        data.qpos[:], data.qvel[:], data.act[:] = y[:i], y[i:j], y[j:]
        data.time = t0 + c[s] * h
        mujoco.mj_forward(model, data)
        K[s] = np.concatenate((data.qvel, data.qacc, data.act_dot))
    y = y0 + h * b @ K
    data.qpos[:], data.qvel[:], data.act[:] = y[:i], y[i:j], y[j:]
    data.time = t0 + h
