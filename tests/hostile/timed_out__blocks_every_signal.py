"""Nor blocked."""
# limits: cpu_s=0.3 wall_s=0.6

import signal

signal.pthread_sigmask(signal.SIG_BLOCK, range(1, 65))
while True:
    pass
