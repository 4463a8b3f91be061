# diagnosis: wrong order
import mujoco
def largest_stable_timestep(integrator, model):
    model.opt.timestep=.01
    return None
