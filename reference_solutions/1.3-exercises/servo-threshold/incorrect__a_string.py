# diagnosis: must return (h_stable, h_unstable)
def largest_stable_timestep(model, integrator):
    return "about 20 ms"
