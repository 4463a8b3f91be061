"""process_vm_readv: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 310, "aarch64": 270}[platform.machine()], 1, 0, 0, 0, 0, 0)
