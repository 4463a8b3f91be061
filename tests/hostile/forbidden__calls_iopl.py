"""iopl: the process ends with SIGSYS."""
# machine: x86_64

import ctypes

ctypes.CDLL(None).syscall(172, 3)
