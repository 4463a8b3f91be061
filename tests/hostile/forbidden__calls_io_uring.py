"""io_uring: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(425, 1, 0)
