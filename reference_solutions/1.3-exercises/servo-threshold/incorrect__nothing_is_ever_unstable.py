# diagnosis: without a single step
def largest_stable_timestep(model, integrator):
    return None
