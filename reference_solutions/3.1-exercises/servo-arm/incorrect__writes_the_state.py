# diagnosis: The function writes data.qpos
def control(model, data, target):
    data.qpos[0] = target
    data.qvel[0] = 0
    return 0.0
