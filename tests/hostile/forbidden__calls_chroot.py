"""chroot: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(161, b'/')
