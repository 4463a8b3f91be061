"""move_pages: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(279, 0, 0, 0, 0, 0, 0)
