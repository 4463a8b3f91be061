# diagnosis: write the value down
import mujoco, sys
x = input("h? ")
def largest_stable_timestep(model, integrator):
    return None
