# diagnosis: whose x was taken for degrees
"""quarter period by integration of own mj_step nstep, bisected to event."""
import mujoco
import numpy as np

def _crossings(model, data, n):
    prev_t, prev_q = data.time, data.qpos[0]
    found = 0
    while found < n:
        mujoco.mj_step(model, data, nstep=2)
        t, q = data.time, float(data.qpos[0])
        if prev_q * q <= 0 and prev_q != q:
            found += 1
            yield prev_t + (t - prev_t) * prev_q / (prev_q - q)
        prev_t, prev_q = t, q

def periods(model, data, x):
    def one(a):
        d = mujoco.MjData(model)
        d.qpos = np.deg2rad(a)
        c = list(_crossings(model, d, 3))
        return c[2] - c[0]
    return {"period": list(map(one, np.asarray(x).ravel()))}
