"""A pipe that nobody writes to."""
# limits: cpu_s=0.3 wall_s=0.6

import os

r, w = os.pipe()
os.read(r, 1)
