"""Finds the largest stable timestep of a scene. It predicts the limit by linearisation, tries timesteps by simulation,
and narrows a bracket by bisection."""
