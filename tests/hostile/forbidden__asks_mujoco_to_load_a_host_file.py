"""MuJoCo opens files in C; the walls are the kernel's."""

import ctypes
import os

assert ctypes.CDLL(None).open(b"/etc/passwd", 0) == -1
os.open("/etc/passwd", os.O_RDONLY)
