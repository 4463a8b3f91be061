"""memfd_secret: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(447, 0)
