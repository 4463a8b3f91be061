"""Code that is compiled under the name of a library's file, and uses ctypes."""

import ctypes
import mujoco
import numpy

library = f"{mujoco.__path__[0]}/libmujoco.so.{mujoco.__version__}"
text = f"""
import ctypes
libmujoco = ctypes.CDLL({library!r})

def advance(model, data):
    libmujoco.mj_step(ctypes.c_void_p(model._address), ctypes.c_void_p(data._address))
"""
names = {}
exec(compile(text, numpy.__file__, "exec"), names)
step = names["advance"]
