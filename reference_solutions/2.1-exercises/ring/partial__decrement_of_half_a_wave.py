# diagnosis: the decay from one peak to the next
"""peaks by parabola; backward looking settle."""
from itertools import takewhile
import mujoco
import numpy as np

def ring(model, data):
    h = model.opt.timestep
    n = int(round(12 / h))
    q = np.empty(n + 1)
    q[0] = data.qpos[0]
    for i in range(n):
        mujoco.mj_step(model, data)
        q[i + 1] = data.qpos.item()
    t = h * np.arange(n + 1)
    k = np.where((np.abs(q[1:-1]) > np.abs(q[:-2])) & (np.abs(q[1:-1]) >= np.abs(q[2:])))[0] + 1
    k = k[np.abs(q[k]) > 1e-3]
    rate = -np.polynomial.Polynomial.fit(np.arange(len(k)), np.log(np.abs(q[k])), 1).convert().coef[1]
    tail = len(list(takewhile(lambda x: abs(x) <= 0.05, q[::-1])))
    return {"rate": rate, "settled": t[n + 1 - tail], "angle": q[500]}
