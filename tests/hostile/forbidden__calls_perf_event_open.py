"""perf_event_open: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(298, 0, 0, -1, -1, 0)
