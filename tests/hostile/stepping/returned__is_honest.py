"""RK4 over mj_forward, with a demo that steps at its end and a library imported where it is needed."""

import mujoco
import numpy as np
from mjcourse import model_path


def step(model, data):
    from scipy.linalg import solve

    h, q0, v0 = model.opt.timestep, data.qpos.copy(), data.qvel.copy()
    t0, dq, dv = data.time, [], []
    for fraction in (0, 0.5, 0.5, 1):
        data.time = t0 + fraction * h
        data.qpos[:] = q0 + (fraction * h * dq[-1] if dq else 0)
        data.qvel[:] = v0 + (fraction * h * dv[-1] if dv else 0)
        mujoco.mj_forward(model, data)
        dq.append(data.qvel.copy())
        dv.append(data.qacc.copy())
    weights = solve(np.diag([6.0, 3.0, 3.0, 6.0]), np.ones(4))
    data.qpos[:] = q0 + h * weights @ dq
    data.qvel[:] = v0 + h * weights @ dv
    data.time = t0 + h


model = mujoco.MjModel.from_xml_path(str(model_path("pendulum")))
data = mujoco.MjData(model)
for _ in range(10):
    mujoco.mj_step(model, data)
assert data.time > 0.01
