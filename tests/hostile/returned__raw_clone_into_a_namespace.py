"""A thread that asks for a new user namespace."""

import ctypes

libc = ctypes.CDLL(None)
assert libc.syscall(56, 0x10000000 | 0x10900, 0, 0, 0, 0) == -1
assert libc.syscall(56, 0x10000000 | 17, 0, 0, 0, 0) == -1
