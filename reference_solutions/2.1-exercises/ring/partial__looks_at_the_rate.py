# diagnosis: The angle of step 500 is measured of data.qvel[0]
import mujoco
import numpy as np


def step_again(model):
    data = mujoco.MjData(model)
    data.qpos[0] = START[0]
    for _ in range(500):
        mujoco.mj_step(model, data)
    return data.qvel[0]


START = [0.0]


def ring(model, data):
    START[0] = data.qpos[0]
    times, angles = [data.time], [data.qpos[0]]
    while data.time < 12:
        mujoco.mj_step(model, data)
        times.append(data.time)
        angles.append(data.qpos[0])
    times, angles = np.array(times), np.array(angles)
    peaks = np.flatnonzero((angles[1:-1] > angles[:-2]) & (angles[1:-1] >= angles[2:])) + 1
    rate = -np.polyfit(times[peaks], np.log(angles[peaks]), 1)[0]
    outside = np.flatnonzero(np.abs(angles) > 0.05)
    return {"rate": rate, "settled": times[outside[-1] + 1], "angle": step_again(model)}
