"""mq_open."""

import ctypes

assert ctypes.CDLL(None).syscall(240, b'/q', 0o102, 0o600, 0) == -1
