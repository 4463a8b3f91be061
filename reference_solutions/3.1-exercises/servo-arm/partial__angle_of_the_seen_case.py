# diagnosis: The controls do not depend on the target
def control(model, data, target):
    return 40 * (1.2 - data.qpos[0]) - 7 * data.qvel[0] + data.qfrc_bias[0]
