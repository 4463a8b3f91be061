"""Regrades: submissions graded again by changed content, as background jobs. They run after live jobs, in pieces that
an interruption repeats and never doubles."""
