"""umount: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 166, "aarch64": 39}[platform.machine()], 0, 0)
