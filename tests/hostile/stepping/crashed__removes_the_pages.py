"""The pages that were laid over the library, unmapped: nothing comes up from below."""

import ctypes
import mujoco

libmujoco = ctypes.CDLL(f"{mujoco.__path__[0]}/libmujoco.so.{mujoco.__version__}")
libc = ctypes.CDLL(None)
start = ctypes.cast(libmujoco.mj_step, ctypes.c_void_p).value & -4096


def step(model, data):
    libc.munmap(ctypes.c_void_p(start), ctypes.c_size_t(4096))
    mujoco.mj_step(model, data)
