"""userfaultfd: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(323, 0)
