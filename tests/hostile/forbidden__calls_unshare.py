"""unshare: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 272, "aarch64": 97}[platform.machine()], 0x10000000)
