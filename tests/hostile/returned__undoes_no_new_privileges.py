"""prctl: only the name of a thread may be set."""

import ctypes

libc = ctypes.CDLL(None)
for option in (1, 4, 8, 22, 23, 24, 38, 47, 1499557217):
    assert libc.prctl(option, 0, 0, 0, 0) == -1, option
