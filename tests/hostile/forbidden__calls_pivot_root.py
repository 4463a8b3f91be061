"""pivot_root: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 155, "aarch64": 41}[platform.machine()], 0, 0)
