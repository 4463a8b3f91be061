"""userfaultfd: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 323, "aarch64": 282}[platform.machine()], 0)
