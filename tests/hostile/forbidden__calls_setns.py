"""setns: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(308, 0, 0)
