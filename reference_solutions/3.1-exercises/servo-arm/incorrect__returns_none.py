# diagnosis: The function returns None
def control(model, data, target):
    u = 80 * (target - data.qpos[0]) - 8 * data.qvel[0] + data.qfrc_bias[0]
