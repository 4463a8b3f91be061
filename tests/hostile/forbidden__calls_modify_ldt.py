"""modify_ldt: the process ends with SIGSYS."""
# machine: x86_64

import ctypes

ctypes.CDLL(None).syscall(154, 0, 0, 0)
