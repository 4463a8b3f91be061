"""A jump behind the first bytes of an integrator."""

import ctypes
import mujoco

libmujoco = ctypes.CDLL(f"{mujoco.__path__[0]}/libmujoco.so.{mujoco.__version__}")
middle = ctypes.cast(libmujoco.mj_RungeKutta, ctypes.c_void_p).value + 256


def step(model, data):
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)(middle)(model._address, data._address, 4)
