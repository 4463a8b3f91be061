# mistake: It hands the step to SciPy's adaptive RK45, which is another method with its own step control.
# next: Write the four classical stages yourself with NumPy.
# status: partial
# told: Your step is taken by scipy.integrate, whose functions choose the method
import mujoco
import numpy as np
from scipy.integrate import solve_ivp


def rk4_step(model, data):
    n = model.nq

    def f(t, y):
        data.qpos[:] = y[:n]
        data.qvel[:] = y[n:2 * n]
        data.act[:] = y[2 * n:]
        data.time = t
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qvel, data.qacc, data.act_dot])

    t = data.time
    h = model.opt.timestep
    y0 = np.concatenate([data.qpos, data.qvel, data.act])
    sol = solve_ivp(f, (t, t + h), y0, method="RK45")
    y = sol.y[:, -1]
    data.qpos[:] = y[:n]
    data.qvel[:] = y[n:2 * n]
    data.act[:] = y[2 * n:]
    data.time = t + h
