# diagnosis: at an end of what the actuator gives
def control(model, data, target):
    q, v = data.qpos[0], data.qvel[0]
    return 60 * (target - q) - 8 * data.qacc[0] + data.qfrc_bias[0]
