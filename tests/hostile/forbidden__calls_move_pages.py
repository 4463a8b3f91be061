"""move_pages: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 279, "aarch64": 239}[platform.machine()], 0, 0, 0, 0, 0, 0)
