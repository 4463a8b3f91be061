# diagnosis: carry gravity has the wrong sign
def control(model, data, target):
    return 40 * (target - data.qpos[0]) - 7 * data.qvel[0] - data.qfrc_bias[0]
