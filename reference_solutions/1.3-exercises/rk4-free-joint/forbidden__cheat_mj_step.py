# diagnosis: The function let MuJoCo take the step
import mujoco


def rk4_step(model, data):
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    mujoco.mj_step(model, data)
