"""reboot: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(169, 0, 0, 0, 0)
