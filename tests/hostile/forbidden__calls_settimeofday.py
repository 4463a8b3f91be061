"""settimeofday: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 164, "aarch64": 170}[platform.machine()], 0, 0)
