"""The x32 numbers of the same calls."""

import ctypes

ctypes.CDLL(None).syscall(0x40000000 + 39)
