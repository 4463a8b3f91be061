# diagnosis: The gain on rate has the wrong sign
def control(model, data, target):
    return 40 * (target - data.qpos[0]) + 7 * data.qvel[0]
