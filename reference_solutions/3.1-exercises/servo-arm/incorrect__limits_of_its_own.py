# diagnosis: your function limits them, let it use the actuator
def control(model, data, target):
    q, v = data.qpos[0], data.qvel[0]
    return max(-2, min(2, 60 * (target - q) - 8 * v + data.qfrc_bias[0]))
