# diagnosis: The function let MuJoCo take the step
import mujoco


def rk4_step(model, data):
    mujoco.mj_step1(model, data)
    mujoco.mj_step2(model, data)
