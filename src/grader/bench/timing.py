"""CPU time as paired ratios: the work and a yardstick take turns in one run, so that load on the machine cancels.

Also switches the profiling timer that MuJoCo's Python wheel installs and `mj_resetCallbacks` removes.
"""

import ctypes
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import mujoco
import numpy as np

ResultT = TypeVar("ResultT")

_library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
_callback = ctypes.c_void_p.in_dll(_library, "mjcb_time")
_as_found = _callback.value


def timer_is_known() -> bool:
    """False where the timer was removed before this module was imported, so that it cannot be restored."""
    return _as_found is not None


@contextmanager
def profiling_timer() -> Iterator[None]:
    """Restore the timer, as the wheel installs it at import, for the duration of a measurement."""
    before = _callback.value
    _callback.value = _as_found
    try:
        yield
    finally:
        _callback.value = before


SAMPLE_S = 1e-3
"""Shortest sample [s]: far above the clock's resolution and the cost of reading it."""


def with_timer(work: Callable[[], ResultT]) -> Callable[[], ResultT]:
    """The same work with the wheel's profiling timer on."""

    def timed() -> ResultT:
        with profiling_timer():
            return work()

    return timed


@dataclass(frozen=True)
class Paired:
    """CPU time of the work over that of the yardstick: median `ratio`, with `low` and `high` around the middle 80 %.

    `seconds` and `yardstick_s` are the shortest CPU times of one call in this thread [s].
    """

    ratio: float
    low: float
    high: float
    seconds: float
    yardstick_s: float
    pairs: int


def calls_per_sample(*works: Callable[[], object]) -> list[int]:
    """Call each work once, then return how often to call each so that all samples last equally long, SAMPLE_S or more.

    A short sample right after a long one of another work would measure cold caches.
    """
    once = []
    for work in works:
        work()
        once.append(max(sample(work, 1), 1e-7))
    return [max(1, round(max(SAMPLE_S, *once) / each)) for each in once]


def sample(work: Callable[[], object], calls: int) -> float:
    """CPU time of one call [s], averaged over `calls`."""
    start = time.thread_time()
    for _ in range(calls):
        work()
    return (time.thread_time() - start) / calls


def paired(
    work: Callable[[], object], yardstick: Callable[[], object], budget_s: float = 0.2, least: int = 5
) -> Paired:
    """Measure pairs for `budget_s` of CPU time [s]: at least `least` of them, at most 200.

    The order within a pair alternates, so that a drift of the clock frequency does not favour either side.
    """
    counts = calls_per_sample(work, yardstick)
    pairs: list[tuple[float, float]] = []
    end = time.thread_time() + budget_s
    while len(pairs) < least or (time.thread_time() < end and len(pairs) < 200):
        if len(pairs) % 2:
            second = sample(yardstick, counts[1])
            pairs.append((sample(work, counts[0]), second))
        else:
            pairs.append((sample(work, counts[0]), sample(yardstick, counts[1])))
    times = np.array(pairs)
    ratios = times[:, 0] / times[:, 1]
    low, middle, high = np.percentile(ratios, [10, 50, 90])
    return Paired(
        ratio=float(middle),
        low=float(low),
        high=float(high),
        seconds=float(times[:, 0].min()),
        yardstick_s=float(times[:, 1].min()),
        pairs=len(pairs),
    )
