"""mq_open."""

import ctypes
import platform

assert ctypes.CDLL(None).syscall({"x86_64": 240, "aarch64": 180}[platform.machine()], b'/q', 0o102, 0o600, 0) == -1
