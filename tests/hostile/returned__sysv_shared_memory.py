"""System V shared memory, semaphores, messages."""

import ctypes

libc = ctypes.CDLL(None)
assert libc.shmget(0, 4096, 0o1600) == -1
assert libc.semget(0, 1, 0o1600) == -1
assert libc.msgget(0, 0o1600) == -1
