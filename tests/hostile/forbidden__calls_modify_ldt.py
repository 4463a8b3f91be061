"""modify_ldt: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(154, 0, 0, 0)
