"""kexec: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 246, "aarch64": 104}[platform.machine()], 0, 0, 0, 0)
