"""add_key: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 248, "aarch64": 217}[platform.machine()], 0, 0, 0, 0, 0)
