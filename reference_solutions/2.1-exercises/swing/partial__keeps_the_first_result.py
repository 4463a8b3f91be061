# diagnosis: is right in the first case, and the same in all later ones
import mujoco
import numpy as np

known = {}


def swing(model, data):
    if not known:
        t, q, v = [], [], []
        while data.time < 6:
            mujoco.mj_step(model, data)
            t.append(data.time)
            q.append(data.qpos[0])
            v.append(data.qvel[0])
        t, q = np.array(t), np.array(q)
        i = np.flatnonzero((q[:-1] > 0) & (q[1:] <= 0))
        period = np.diff(t[i] + (t[i + 1] - t[i]) * q[i] / (q[i] - q[i + 1])).mean()
        known.update(period=period, frequency=1 / period, speed=np.abs(v).max())
    return known
