"""Chooses integrator and timestep for one model. It measures the error of every setting against a reference solution,
and picks the cheapest that meets a tolerance."""
