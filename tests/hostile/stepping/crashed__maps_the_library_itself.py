"""The library's code, mapped by hand at another address, as the dynamic linker does."""

import mmap
import mujoco

path = f"{mujoco.__path__[0]}/libmujoco.so.{mujoco.__version__}"
with open(path, "rb") as file:
    code = mmap.mmap(file.fileno(), 1 << 20, flags=mmap.MAP_PRIVATE, prot=mmap.PROT_READ | mmap.PROT_EXEC)


def step(model, data):
    mujoco.mj_step(model, data)
