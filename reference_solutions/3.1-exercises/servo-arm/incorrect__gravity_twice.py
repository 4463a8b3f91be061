# diagnosis: carry gravity twice
def control(model, data, target):
    return 40 * (target - data.qpos[0]) - 7 * data.qvel[0] + 2 * data.qfrc_bias[0]
