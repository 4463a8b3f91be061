import numpy as np

total = 0.0


def control(model, data, target):
    global total
    if data.time == 0:
        total = 0.0
    error = target - data.qpos[0]
    if abs(error) < 0.3:
        total = np.clip(total + 0.004 * error, -0.2, 0.2)
    return float(np.clip(40 * error + 20 * total - 7 * data.qvel[0] + data.qfrc_bias[0], -12, 12))
