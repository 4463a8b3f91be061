# diagnosis: Period is half a period
import mujoco
import numpy as np


def time_swing(model, data):
    ups, before = [], data.qpos[0]
    while len(ups) < 3:
        mujoco.mj_step(model, data)
        now = data.qpos[0]
        if before * now <= 0:
            ups.append(data.time - model.opt.timestep * now / (now - before))
        before = now
    return (ups[-1] - ups[0]) / 2


def periods(model, data, x):
    found = []
    for angle in x:
        mujoco.mj_resetData(model, data)
        data.qpos[0] = angle
        found.append(time_swing(model, data))
    return {"period": found}
