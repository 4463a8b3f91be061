"""A thread that asks for a new user namespace."""

import ctypes
import platform

libc = ctypes.CDLL(None)
number = {"x86_64": 56, "aarch64": 220}[platform.machine()]
assert libc.syscall(number, 0x10000000 | 0x10900, 0, 0, 0, 0) == -1
assert libc.syscall(number, 0x10000000 | 17, 0, 0, 0, 0) == -1
