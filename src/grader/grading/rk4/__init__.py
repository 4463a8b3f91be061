"""A Runge-Kutta step over mj_forward: the student's trajectories against our own, with the same hidden force."""
