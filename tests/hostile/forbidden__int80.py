"""The 32-bit door to the same kernel, whose numbers mean other calls: an `int 0x80` found in a library's code."""
# machine: x86_64

import ctypes
import mujoco

library = ctypes.CDLL(mujoco.__path__[0] + "/libmujoco.so." + mujoco.__version__)
start = ctypes.cast(library.mj_forward, ctypes.c_void_p).value
code = ctypes.string_at(start, 3 << 20)
ctypes.CFUNCTYPE(ctypes.c_int)(start + code.index(b"\xcd\x80"))()
