# diagnosis: The controls do not depend on rate
def control(model, data, target):
    q, v = data.qpos[0], data.qvel[0]
    return 60 * (target - q) - 8 * q + data.qfrc_bias[0]
