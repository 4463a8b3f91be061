"""Studies of MuJoCo. They are benchmarks that anyone can repeat, and advice on integrator and timestep."""
