# diagnosis: is counted from the start of the run
import mujoco
import numpy as np


class Recorder:
    def __init__(self, model, data):
        self.m, self.d = model, data

    def __iter__(self):
        while self.d.time < 6.0:
            yield self.d.time, float(self.d.qpos[0]), float(self.d.qvel[0])
            mujoco.mj_step(self.m, self.d)


def swing(model, data):
    rec = np.array(list(Recorder(model, data)))
    t, q, v = rec.T
    # moments of standstill: v passes 0 downward
    i = np.flatnonzero((q[:-1] < 0) & (q[1:] >= 0))
    cross = [np.interp(0.0, q[k:k + 2], t[k:k + 2]) for k in i]
    T = cross[0]
    return dict(period=T, frequency=1 / T, speed=np.abs(v).max())
