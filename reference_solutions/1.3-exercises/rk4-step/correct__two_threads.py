"""Asks for accelerations on a scratch copy at the same time, then steps by the classical method."""
from concurrent.futures import ThreadPoolExecutor
import mujoco

POOL = ThreadPoolExecutor(2)


def rk4_step(model, data):
    h = model.opt.timestep
    t0, q0, v0, act0 = data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()

    list(POOL.map(lambda one: mujoco.mj_forward(model, one), [data, mujoco.MjData(model)]))

    def slope(q, v, act, t):
        data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, act, t
        mujoco.mj_forward(model, data)
        return v, data.qacc.copy(), data.act_dot.copy()

    k1 = slope(q0, v0, act0, t0)
    k2 = slope(q0 + h / 2 * k1[0], v0 + h / 2 * k1[1], act0 + h / 2 * k1[2], t0 + h / 2)
    k3 = slope(q0 + h / 2 * k2[0], v0 + h / 2 * k2[1], act0 + h / 2 * k2[2], t0 + h / 2)
    k4 = slope(q0 + h * k3[0], v0 + h * k3[1], act0 + h * k3[2], t0 + h)
    q, v, act = (
        x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q0, v0, act0), k1, k2, k3, k4)
    )
    data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, act, t0 + h
