"""Waits without using the CPU."""
# limits: cpu_s=0.3 wall_s=0.6

import time

time.sleep(1000)
