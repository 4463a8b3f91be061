"""Nor for exit handlers."""
# limits: cpu_s=0.3 wall_s=0.6

import atexit


def hang():
    while True:
        pass


atexit.register(hang)
