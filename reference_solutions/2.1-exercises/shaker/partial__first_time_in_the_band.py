# diagnosis: Settling time is the first time within the band
import mujoco
import numpy as np


def run(model, data, push, seconds):
    times, places = [data.time], [data.qpos[0]]
    while data.time < seconds:
        data.ctrl[0] = push(data.time)
        mujoco.mj_step(model, data)
        times.append(data.time)
        places.append(data.qpos[0])
    return np.array(times), np.array(places)


def shake(model, data):
    times, places = run(model, data, lambda t: 8 * np.sin(6 * t), 9)
    late = places[times > 6]
    amplitude = (late.max() - late.min()) / 2
    mujoco.mj_resetData(model, data)
    times, places = run(model, data, lambda t: 12.0, 6)
    inside = np.flatnonzero(np.abs(places - places[-1]) <= 0.002)
    rest = places[-1]
    return {"amplitude": amplitude, "settled": times[inside[0]], "rest": (rest - 5e-5, rest + 5e-5)}
