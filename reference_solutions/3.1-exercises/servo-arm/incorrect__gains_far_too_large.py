# diagnosis: The gain on angle is far too large
def control(model, data, target):
    return 40000 * (target - data.qpos[0]) - 7 * data.qvel[0]
