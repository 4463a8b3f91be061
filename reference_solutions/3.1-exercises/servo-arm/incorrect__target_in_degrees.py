# diagnosis: The target, as the controls use it, is off by the factor
def control(model, data, target):
    q, v = data.qpos[0], data.qvel[0]
    return 60 * (180 / 3.14159 * target - q) - 8 * v + data.qfrc_bias[0]
