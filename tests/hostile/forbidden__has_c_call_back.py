"""A callback from C would need memory that is writable and executable."""

import ctypes

ctypes.CFUNCTYPE(ctypes.c_int)(lambda: 1)()
