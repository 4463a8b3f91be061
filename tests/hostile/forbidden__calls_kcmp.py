"""kcmp: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 312, "aarch64": 272}[platform.machine()], 1, 1, 0, 0, 0)
