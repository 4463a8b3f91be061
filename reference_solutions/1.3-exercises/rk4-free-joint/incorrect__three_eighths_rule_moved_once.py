# diagnosis: second order on rotations only
import mujoco
import numpy as np

STAGES = ([], [1 / 3], [-1 / 3, 1], [1, -1, 1])
WEIGHTS = (1 / 8, 3 / 8, 3 / 8, 1 / 8)


def rk4_step(model, data):
    """Kutta's 3/8 rule, with the velocities of the stages summed before they move the positions."""
    h, t0, q0, v0, act0 = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()
    velocities, slopes, rates = [], [], []

    def go(weights, part):
        def total(parts):
            return sum((w * x for w, x in zip(weights, parts)), np.zeros_like(parts[0]) if parts else 0.0)

        data.qpos[:], data.time = q0, t0 + part * h
        if velocities:
            mujoco.mj_integratePos(model, data.qpos, total(velocities), h)
        data.qvel[:], data.act[:] = v0 + h * total(slopes), act0 + h * total(rates)

    for row in STAGES:
        go(row, sum(row))
        mujoco.mj_forward(model, data)
        velocities.append(data.qvel.copy())
        slopes.append(data.qacc.copy())
        rates.append(data.act_dot.copy())
    go(WEIGHTS, 1)
