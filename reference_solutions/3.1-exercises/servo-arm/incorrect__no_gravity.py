# diagnosis: It comes to rest beside the target
def control(model, data, target):
    return 25 * (target - data.qpos[0]) - 4 * data.qvel[0]
