"""Mutants of the right Runge-Kutta step, run beside the student's from the same states, to name what the tableau of a
step does not show: a call that is left out, a state that is not put back, an acceleration that is changed."""
