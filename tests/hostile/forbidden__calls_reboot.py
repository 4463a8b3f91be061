"""reboot: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 169, "aarch64": 142}[platform.machine()], 0, 0, 0, 0)
