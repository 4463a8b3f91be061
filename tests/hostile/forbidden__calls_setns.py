"""setns: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 308, "aarch64": 268}[platform.machine()], 0, 0)
