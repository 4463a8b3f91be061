"""ctypes called by a thread pool: all frames on its stack are the library's."""

import ctypes
import mujoco
from concurrent.futures import ThreadPoolExecutor

pool = ThreadPoolExecutor(1)


def step(model, data):
    path = f"{mujoco.__path__[0]}/libmujoco.so.{mujoco.__version__}"
    libmujoco = pool.submit(ctypes.CDLL, path).result()
    run = pool.submit(getattr, libmujoco, "mj_step").result()
    pool.submit(run, ctypes.c_void_p(model._address), ctypes.c_void_p(data._address)).result()
