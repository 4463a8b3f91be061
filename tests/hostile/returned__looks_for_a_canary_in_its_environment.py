"""The environment was empty from the start."""

import ctypes
import os

libc = ctypes.CDLL(None)
libc.getenv.restype = ctypes.c_char_p
assert "GRADER_CANARY" not in os.environ
assert libc.getenv(b"GRADER_CANARY") is None
print(dict(os.environ))
