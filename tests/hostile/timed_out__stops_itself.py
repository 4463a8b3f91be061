"""SIGSTOP: pid 1 of a namespace is deaf to it, so it spins on."""
# limits: cpu_s=0.3 wall_s=0.6

import ctypes

ctypes.CDLL(None).syscall(234, 1, 1, 19)
while True:
    pass
