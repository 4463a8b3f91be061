"""MuJoCo's Python wheel as a user finds it: with the profiling timer that `mj_resetCallbacks` removes."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

_library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
_callback = ctypes.c_void_p.in_dll(_library, "mjcb_time")
_as_found = _callback.value


def timer_is_known() -> bool:
    """False where something removed the timer before this module was imported: it cannot be put back then."""
    return _as_found is not None


@contextmanager
def profiling_timer() -> Iterator[None]:
    """The timer as the wheel installs it at import, for the time of a measurement."""
    before = _callback.value
    _callback.value = _as_found
    try:
        yield
    finally:
        _callback.value = before
