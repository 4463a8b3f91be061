# diagnosis: The function let MuJoCo take the step
import mujoco


def rk4_step(model, data):
    mujoco.mj_forward(model, data)
    mujoco.mj_RungeKutta(model, data, 4)
