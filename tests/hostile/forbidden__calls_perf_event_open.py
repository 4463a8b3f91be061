"""perf_event_open: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 298, "aarch64": 241}[platform.machine()], 0, 0, -1, -1, 0)
