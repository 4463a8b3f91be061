"""CPU time as paired ratios: the work and a yardstick take turns in one run, so that load on the machine cancels."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SAMPLE_S = 1e-3
"""Shortest sample [s]: far above the clock's resolution and the cost of reading it."""


@dataclass(frozen=True)
class Paired:
    """How long the work takes, in yardsticks; all times are CPU times of this thread [s]."""

    ratio: float
    low: float
    high: float
    seconds: float
    yardstick_s: float
    pairs: int


def calls_per_sample(*works: Callable[[], object]) -> list[int]:
    """Warm up, then say how often to call each, so that their samples last alike, and SAMPLE_S or more.

    Alike, because a short sample right after a long one of something else would measure how cold the caches are.
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
    """Median of the paired ratios with the band that holds the middle 80 %; at least `least` pairs, at most 200.

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
