# diagnosis: is what a run gives that is shorter than asked
import mujoco
import numpy as np


def ring(model, data):
    times, angles = [data.time], [data.qpos[0]]
    while data.time < 12:
        mujoco.mj_step(model, data)
        times.append(data.time)
        angles.append(data.qpos[0])
    times, angles = np.array(times), np.array(angles)
    peaks = np.flatnonzero((angles[1:-1] > angles[:-2]) & (angles[1:-1] >= angles[2:])) + 1
    rate = -np.polyfit(times[peaks], np.log(angles[peaks]), 1)[0]
    outside = np.flatnonzero(np.abs(angles) > 0.05)
    return {"rate": rate, "settled": times[outside[-1] + 1], "angle": angles[50]}
