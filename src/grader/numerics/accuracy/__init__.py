"""Measures how exact integrators are. It has reference solutions, the distance between runs, the order of convergence,
and the drift of the energy."""
