"""mount: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 165, "aarch64": 40}[platform.machine()], 0, 0, 0, 0, 0)
