"""An instruction that the processor does not know: a `ud2` found in a library's code."""

import ctypes

start = ctypes.cast(ctypes.pythonapi.PyObject_Call, ctypes.c_void_p).value
code = ctypes.string_at(start, 1 << 19)
ctypes.CFUNCTYPE(None)(start + code.index(b"\x0f\x0b"))()
