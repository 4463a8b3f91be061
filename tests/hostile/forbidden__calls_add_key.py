"""add_key: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(248, 0, 0, 0, 0, 0)
