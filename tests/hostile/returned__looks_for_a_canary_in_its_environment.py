"""The environment was empty from the start."""

import ctypes
import os

libc = ctypes.CDLL(None)
libc.getenv.restype = ctypes.c_char_p
assert "GRADER_TEST_CANARY" not in os.environ
assert libc.getenv(b"GRADER_TEST_CANARY") is None
print(dict(os.environ))
