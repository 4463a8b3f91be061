"""Runs and judges a trial with NumPy and MuJoCo alone, on the server and on the learner's own machine."""
