# diagnosis: Period counts one period too many
import mujoco
import numpy as np


def record(model, data, seconds=12):
    times, angles, speeds = [], [], []
    while data.time < seconds:
        times.append(data.time)
        angles.append(data.qpos[0])
        speeds.append(data.qvel[0])
        mujoco.mj_step(model, data)
    return np.array(times), np.array(angles), np.array(speeds)


def crossings(times, angles):
    k = np.flatnonzero((angles[:-1] < 0) & (angles[1:] >= 0))
    return times[k] - angles[k] * (times[k + 1] - times[k]) / (angles[k + 1] - angles[k])


def swing(model, data):
    times, angles, speeds = record(model, data)
    up = crossings(times, angles)
    period = (up[-1] - up[0]) / len(up)
    return {"period": period, "frequency": 1 / period, "speed": np.abs(speeds).max()}
