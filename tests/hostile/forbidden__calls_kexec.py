"""kexec: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(246, 0, 0, 0, 0)
