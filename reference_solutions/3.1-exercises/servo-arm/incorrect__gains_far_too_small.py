# diagnosis: The gain on angle is far too small
def control(model, data, target):
    return 3 * (target - data.qpos[0]) - 4 * data.qvel[0]
