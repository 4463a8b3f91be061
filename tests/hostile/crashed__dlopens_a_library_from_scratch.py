"""A shared object of its own making: scratch is noexec."""

import ctypes
import shutil
import numpy

library = numpy._core._multiarray_umath.__file__
shutil.copyfile(library, "evil.so")
ctypes.CDLL("./evil.so")
