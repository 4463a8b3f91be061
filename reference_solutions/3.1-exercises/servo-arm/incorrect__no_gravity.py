# diagnosis: It does not settle at the target soon enough.
def control(model, data, target):
    return 25 * (target - data.qpos[0]) - 4 * data.qvel[0]
