"""seccomp: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 317, "aarch64": 277}[platform.machine()], 1, 0, 0)
