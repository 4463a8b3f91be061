def largest_stable_timestep(model, integrator):
    return None
