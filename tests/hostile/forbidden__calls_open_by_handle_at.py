"""open_by_handle_at: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 304, "aarch64": 265}[platform.machine()], 0, 0, 0)
