"""kcmp: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(312, 1, 1, 0, 0, 0)
