"""CPU time as paired ratios: the work and a yardstick take turns in one run, so that load on the machine cancels. Also
switches the profiling timer that MuJoCo's Python wheel installs and `mj_resetCallbacks` removes."""

import ctypes
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

_library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
_callback = ctypes.c_void_p.in_dll(_library, "mjcb_time")
_as_found = _callback.value


def is_timer_known() -> bool:
    """False where the timer was removed before this module was imported, so that it cannot be restored."""
    return _as_found is not None


@contextmanager
def restore_timer() -> Iterator[None]:
    """Restore the timer, as the wheel installs it at import, for the duration of a measurement; also a decorator."""
    before = _callback.value
    _callback.value = _as_found
    try:
        yield
    finally:
        _callback.value = before


Clock = Callable[[], float]
"""Returns the CPU time that was used so far [s]."""

LEAST, MOST = 6, 200
"""Numbers of pairs: the extremes of fewer than six enclose the median with a confidence below 95 %."""

SAMPLE_S = 1e-3, 5e-2
"""Shortest sample [s], far above the clock's resolution and the cost of reading it; and the longest that is repeated to
last as long as one of the other work."""


@dataclass(frozen=True)
class TimeRatio:
    """CPU time of the work over that of the yardstick: median `ratio` of the `pairs`, with its 95 % interval. `seconds`
    and `yardstick_s` are the shortest CPU times of one call in this thread [s]."""

    ratio: float
    interval: tuple[float, float]
    seconds: float
    yardstick_s: float
    pairs: tuple[float, ...]

    @property
    def least(self) -> float:
        """The shortest time of the work over that of the yardstick. What disturbs a sample only adds to its time, so on
        a busy machine this is steadier than the median."""
        return self.seconds / self.yardstick_s


def count_calls(*works: Callable[[], object], clock: Clock = time.thread_time) -> list[int]:
    """Call each work twice, then return how often to call each so that all samples last equally long within SAMPLE_S. A
    short sample right after a long one of another work would measure cold caches."""
    once = []
    for work in works:
        work()
        once.append(max(measure_sample(work, 1, clock), 1e-7))
    shortest, longest = SAMPLE_S
    lasting = min(max(shortest, *once), longest)
    return [max(1, round(lasting / each)) for each in once]


def measure_sample(work: Callable[[], object], calls: int, clock: Clock = time.thread_time) -> float:
    """CPU time of one call [s], averaged over `calls`."""
    start = clock()
    for _ in range(calls):
        work()
    return (clock() - start) / calls


def measure_pairs(
    work: Callable[[], object], yardstick: Callable[[], object], budget_s: float = 0.2, clock: Clock = time.thread_time
) -> TimeRatio:
    """Measure pairs for `budget_s` of CPU time [s]: at least LEAST of them, at most MOST. The order within a pair
    alternates, so that a drift of the clock frequency does not favour either side. Work on other threads needs the
    `clock` of the process."""
    works, taken = (work, yardstick), list[list[float]]()
    counts = count_calls(*works, clock=clock)
    end = clock() + budget_s
    while len(taken) < LEAST or (clock() < end and len(taken) < MOST):
        turns = [0, 1] if len(taken) % 2 == 0 else [1, 0]
        pair = {turn: measure_sample(works[turn], counts[turn], clock) for turn in turns}
        taken.append([pair[0], pair[1]])
    times = np.array(taken)
    pairs = tuple((times[:, 0] / times[:, 1]).tolist())
    seconds, yardstick_s = times.min(axis=0).tolist()
    return TimeRatio(float(np.median(pairs)), compute_median_interval(pairs), seconds, yardstick_s, pairs)


RESAMPLES = 2000
"""Bootstrap samples; the ends of an interval then vary by less than a tenth of its width."""


def compute_median_interval(pairs: Sequence[float], over: Sequence[float] = (1.0,)) -> tuple[float, float]:
    """Returns the 95 % confidence interval of the median of independent pairs, or of its quotient over that of others.
    The percentile bootstrap; the same pairs give the same interval. Source: Efron 1979, doi 10.1214/aos/1176344552."""
    medians = resample_medians(tuple(pairs), 0) / resample_medians(tuple(over), 1)
    low, high = np.percentile(medians, (2.5, 97.5)).tolist()
    return low, high


@lru_cache(maxsize=4096)
def resample_medians(pairs: tuple[float, ...], seed: int) -> NDArray[np.float64]:
    """Returns the medians of RESAMPLES samples drawn with replacement, (RESAMPLES,)."""
    drawn = np.random.default_rng(seed).choice(pairs, (RESAMPLES, len(pairs)))
    return np.asarray(np.median(drawn, axis=1))
