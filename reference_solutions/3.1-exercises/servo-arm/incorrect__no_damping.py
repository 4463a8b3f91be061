# diagnosis: The controls do not depend on rate
def control(model, data, target):
    return 40 * (target - data.qpos[0])
