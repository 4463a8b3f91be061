"""A trap for the next import."""

import numpy

open(numpy.__path__[0] + "/trap.py", "w")
