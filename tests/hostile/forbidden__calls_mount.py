"""mount: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(165, 0, 0, 0, 0, 0)
