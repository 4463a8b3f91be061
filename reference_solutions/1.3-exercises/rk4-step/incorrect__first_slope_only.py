# diagnosis: Only the first slope came from mujoco.mj_forward
import mujoco


def rk4_step(model, data):
    mujoco.mj_forward(model, data)
    mujoco.mj_RungeKutta(model, data, 4)
