# diagnosis: appends data.qpos itself
import mujoco
import numpy as np
def swing(model, data):
    t, q, v = [], [], []
    while data.time < 6:
        mujoco.mj_step(model, data)
        t.append(data.time); q.append(data.qpos); v.append(data.qvel)
    t = np.array(t); q = np.array(q)[:, 0]; v = np.array(v)[:, 0]
    i = np.flatnonzero((q[:-1] < 0) & (q[1:] >= 0))
    T = t[i[1]] - t[i[0]]
    return dict(period=T, frequency=1 / T, speed=np.abs(v).max())
