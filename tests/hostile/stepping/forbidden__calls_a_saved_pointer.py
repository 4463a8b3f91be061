"""Pointers into the integrators, saved while the script was imported."""

import ctypes
import mujoco

libmujoco = ctypes.CDLL(f"{mujoco.__path__[0]}/libmujoco.so.{mujoco.__version__}")
runge_kutta = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)(
    ctypes.cast(libmujoco.mj_RungeKutta, ctypes.c_void_p).value
)


def step(model, data):
    mujoco.mj_forward(model, data)
    runge_kutta(model._address, data._address, 4)
