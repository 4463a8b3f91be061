# diagnosis: The gain on angle has the wrong sign
def control(model, data, target):
    return 40 * (data.qpos[0] - target) - 7 * data.qvel[0] + data.qfrc_bias[0]
