"""clone(2) by hand, without CLONE_THREAD."""

import ctypes
import platform

assert ctypes.CDLL(None).syscall({"x86_64": 56, "aarch64": 220}[platform.machine()], 17, 0, 0, 0, 0) == -1
