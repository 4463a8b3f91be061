"""umount: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(166, 0, 0)
