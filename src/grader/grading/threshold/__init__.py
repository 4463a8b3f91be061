"""The largest stable timestep: a claimed bracket per model and integrator, certified by simulating at its ends."""
