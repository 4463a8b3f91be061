"""pivot_root: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(155, 0, 0)
