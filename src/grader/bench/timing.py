"""CPU time as paired ratios: the work and a yardstick take turns in one run, so that load on the machine cancels.

Also switches the profiling timer that MuJoCo's Python wheel installs and `mj_resetCallbacks` removes.
"""

import ctypes
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

_library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
_callback = ctypes.c_void_p.in_dll(_library, "mjcb_time")
_as_found = _callback.value


def timer_is_known() -> bool:
    """False where the timer was removed before this module was imported, so that it cannot be restored."""
    return _as_found is not None


@contextmanager
def profiling_timer() -> Iterator[None]:
    """Restore the timer, as the wheel installs it at import, for the duration of a measurement; also a decorator."""
    before = _callback.value
    _callback.value = _as_found
    try:
        yield
    finally:
        _callback.value = before


SPREAD = (10, 50, 90)
"""Percentiles of the pairs that are quoted."""

SAMPLE_S = 1e-3
"""Shortest sample [s]: far above the clock's resolution and the cost of reading it."""


@dataclass(frozen=True)
class Paired:
    """CPU time of the work over that of the yardstick: median `ratio`, with `low` and `high` around the middle 80 %.

    `seconds` and `yardstick_s` are the shortest CPU times of one call in this thread [s]; `interval` is the 95 %
    confidence interval of the ratio.
    """

    ratio: float
    low: float
    high: float
    seconds: float
    yardstick_s: float
    pairs: int
    interval: tuple[float, float]

    @property
    def least(self) -> float:
        """The shortest time of the work over that of the yardstick.

        What disturbs a sample only adds to its time, so on a busy machine this is steadier than the median.
        """
        return self.seconds / self.yardstick_s


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
    work: Callable[[], object], yardstick: Callable[[], object], budget_s: float = 0.2, least: int = 5, most: int = 200
) -> Paired:
    """Measure pairs for `budget_s` of CPU time [s]: at least `least` of them, at most `most`.

    The order within a pair alternates, so that a drift of the clock frequency does not favour either side.
    """
    works, pairs = (work, yardstick), list[list[float]]()
    counts = calls_per_sample(*works)
    end = time.thread_time() + budget_s
    while len(pairs) < least or (time.thread_time() < end and len(pairs) < most):
        turns = [0, 1] if len(pairs) % 2 == 0 else [1, 0]
        taken = {turn: sample(works[turn], counts[turn]) for turn in turns}
        pairs.append([taken[0], taken[1]])
    times = np.array(pairs)
    ratios = times[:, 0] / times[:, 1]
    low, middle, high = np.percentile(ratios, SPREAD).tolist()
    seconds, yardstick_s = times.min(axis=0).tolist()
    return Paired(middle, low, high, seconds, yardstick_s, len(pairs), median_interval(ratios))


RESAMPLES = 2000
"""Bootstrap samples; the ends of an interval then vary by less than a tenth of its width."""


def median_interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """The 95 % confidence interval of the median of independent values, by the percentile bootstrap.

    Source: Efron 1979, doi 10.1214/aos/1176344552. The same values give the same interval. Of fewer than six values the
    extremes themselves cover less, 1 - 2^(1 - n).
    """
    drawn = np.random.default_rng(0).choice(values, (RESAMPLES, len(values)))
    low, high = np.percentile(np.median(drawn, axis=1), (2.5, 97.5)).tolist()
    return low, high
