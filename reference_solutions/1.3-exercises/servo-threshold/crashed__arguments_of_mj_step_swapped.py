# diagnosis: called with (MjData, MjModel)
import mujoco
def largest_stable_timestep(model, integrator):
    d=mujoco.MjData(model)
    mujoco.mj_step(d, model)
    return None
