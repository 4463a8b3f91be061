"""chroot: the process ends with SIGSYS."""

import ctypes
import platform

ctypes.CDLL(None).syscall({"x86_64": 161, "aarch64": 51}[platform.machine()], b'/')
