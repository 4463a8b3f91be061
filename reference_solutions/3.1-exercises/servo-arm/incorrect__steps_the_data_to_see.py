# diagnosis: The function writes data.time
import mujoco


def control(model, data, target):
    mujoco.mj_step(model, data)
    return 0.1
