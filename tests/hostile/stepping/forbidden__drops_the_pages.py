"""The pages that were laid over the library, thrown away in every manner that madvise knows."""

import ctypes
import mujoco

libmujoco = ctypes.CDLL(f"{mujoco.__path__[0]}/libmujoco.so.{mujoco.__version__}")
libc = ctypes.CDLL(None)
start = ctypes.cast(libmujoco.mj_step, ctypes.c_void_p).value & -4096


def step(model, data):
    for advice in (*range(26), 100, 101):
        libc.madvise(ctypes.c_void_p(start), ctypes.c_size_t(4096), advice)
    mujoco.mj_step(model, data)
