"""Measures quantities in a time series: the number that a claim is about. NaN where a series does not have it."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from math import nan

import numpy as np
from numpy.typing import NDArray

from grader.domain.quantities import Direction, QuantityName, Window

Floats = NDArray[np.float64]

TIME_SLACK_S = 1e-9
"""Rounding of sums of timesteps."""

PEAKS_MIN = 3
"""Peaks without which no decay is measured."""

HALF_WAVES = 3
"""Half-waves without which no rest position is estimated."""

SMOOTH = 0.25
"""The part of the curvature at a peak that its neighbours have too, unless the series jumps there: of a sine with eight
frames a period they have 0.41 or more, beside a jump nothing or the other sign."""

EVERYTHING = Window()
"""The whole series."""


def measure(name: QuantityName, times: Floats, values: Floats, window: Window = EVERYTHING) -> float:
    """Returns a quantity of a series (n,) at `times` (n,) [s]; NaN where the series does not have it. Of the last value
    alone the others need not be finite, such as a quotient by the time."""
    times, values = cut(times, values, window)
    if not len(times) or not np.isfinite(values[-1:] if name == "final" else values).all():
        return nan
    return float(MEASURES[name](times, values, window))


def measure_waves(name: QuantityName, times: Floats, values: Floats, window: Window = EVERYTHING) -> Floats:
    """Returns a quantity of WAVES of each wave of a series by itself, which `measure` takes over all of them: periods
    and frequencies between two crossings, rates between two peaks."""
    return WAVES[name](*cut(times, values, window), window)


def cut(times: Floats, values: Floats, window: Window) -> tuple[Floats, Floats]:
    """Returns the part of a series that a window shows."""
    inside = times >= window.since - TIME_SLACK_S
    if window.until is not None:
        inside &= times <= window.until + TIME_SLACK_S
    return times[inside], values[inside]


def read_trace(times: Floats, values: Floats, at_s: Floats) -> Floats:
    """Returns the values at some moments [s], between two frames by a straight line."""
    return np.interp(at_s, times, values)


def find_max(times: Floats, values: Floats, window: Window) -> float:
    """The largest value, between frames by a parabola through the largest and its neighbours."""
    at = int(np.argmax(values))
    return refine_peak(values, at)[1]


def find_min(times: Floats, values: Floats, window: Window) -> float:
    """The smallest value, as the largest of the negative."""
    return -find_max(times, -values, window)


def refine_peak(values: Floats, at: int) -> tuple[float, float]:
    """Returns where the parabola through a frame and its neighbours has its top [frames], and its height. Where the
    series jumps or has a kink, no parabola passes through it: the frame itself is the top."""
    if not 0 < at < len(values) - 1:
        return float(at), float(values[at])
    before, top, after = (float(value) for value in values[at - 1 : at + 2])
    bend = before - 2 * top + after
    beside = np.diff(values[max(at - 2, 0) : at + 3], 2)
    if bend >= 0 or len(beside) < 2 or beside.max() > SMOOTH * bend:
        return float(at), top
    shift = (before - after) / (2 * bend)
    return at + shift, top - (before - after) * shift / 4


def find_mean(times: Floats, values: Floats, window: Window) -> float:
    """The mean over time."""
    length = times[-1] - times[0]
    return float(np.trapezoid(values, times) / length) if length > 0 else float(values[0])


def find_rms(times: Floats, values: Floats, window: Window) -> float:
    """The root of the mean square over time."""
    return float(np.sqrt(find_mean(times, values**2, window)))


def find_peak_to_peak(times: Floats, values: Floats, window: Window) -> float:
    """The largest value less the smallest one."""
    return find_max(times, values, window) - find_min(times, values, window)


ABSENCES = {
    "crossing": "; crossings go up unless `direction` says down or either",
    "decay_rate": "; it is read from peaks above the `level`: without a swing, ask for the crossing of 1/e",
}
"""What authors miss of quantities that a run has not."""


def explain_absence(quantity: str, expr: str) -> str:
    """Returns why a run has not a quantity of an expression, with the cure."""
    if quantity in ("end", "final", "max", "min", "mean", "rms"):
        before = "set in setup what it reads of ctx, since no controller has run at the start"
        when = "at the end" if quantity in ("end", "final") else "throughout"
        return f"{expr} has not a finite value {when}: {before if 'ctx.' in expr else 'mend expr'}"
    return f"the run has no {quantity.replace('_', ' ')}: make it longer, or mend expr{ABSENCES.get(quantity, '')}"


def find_crossings(times: Floats, values: Floats, level: float, direction: Direction) -> Floats:
    """Returns the moments at which a series crosses a level [s], between frames by a straight line."""
    above = values - level
    rises, falls = (above[:-1] < 0) & (above[1:] >= 0), (above[:-1] > 0) & (above[1:] <= 0)
    wanted = {"up": rises, "down": falls, "either": rises | falls}[direction]
    at = np.flatnonzero(wanted)
    share = above[at] / (above[at] - above[at + 1])
    return np.asarray(times[at] + share * (times[at + 1] - times[at]))


def find_crossing(times: Floats, values: Floats, window: Window) -> float:
    """The moment of one crossing [s]."""
    crossings = find_crossings(times, values, window.level or 0.0, window.direction)
    return float(crossings[window.count - 1]) if len(crossings) >= window.count else nan


def find_period(times: Floats, values: Floats, window: Window) -> float:
    """The mean time between two upward crossings [s]."""
    crossings = find_rises(times, values, window)
    return float((crossings[-1] - crossings[0]) / (len(crossings) - 1)) if len(crossings) > 1 else nan


def find_rises(times: Floats, values: Floats, window: Window) -> Floats:
    """The moments of the upward crossings [s], of the rest position where no level is given."""
    level = estimate_rest(times, values) if window.level is None else window.level
    return find_crossings(times, values, level, "up")


def estimate_rest(times: Floats, values: Floats) -> float:
    """Returns the level about which a series oscillates: of the last three whole half-waves the mean of the two
    outer peaks and the one between, so that a decay is off by the square of its share in half a wave alone. A peak is
    the farthest value between two crossings of the middle. With fewer half-waves it is the middle between the largest
    and the smallest value."""
    middle = float(values.max() + values.min()) / 2
    at = np.searchsorted(times, find_crossings(times, values, middle, "either"))
    if len(at) <= HALF_WAVES:
        return middle
    spans = [values[begin:end] - middle for begin, end in pairwise(at[-HALF_WAVES - 1 :])]
    first, second, third = (float(span[np.abs(span).argmax()]) for span in spans)
    return middle + (first + 2 * second + third) / 4


def find_decay_rate(times: Floats, values: Floats, window: Window) -> float:
    """The rate at which the peaks above the level decay [1/s]: the slope of their logarithm, by least squares."""
    moments, heights = find_peaks(times, values, window)
    return -float(np.polyfit(moments, np.log(heights), 1)[0]) if len(moments) >= PEAKS_MIN else nan


def find_peaks(times: Floats, values: Floats, window: Window) -> tuple[Floats, Floats]:
    """The moments of the peaks above the level [s], and their heights above it."""
    above = values - (window.level or 0.0)
    before, here, after = above[:-2], above[1:-1], above[2:]
    tops = 1 + np.flatnonzero((before < here) & (here >= after) & (here > 0))
    peaks = np.array([refine_peak(above, int(top)) for top in tops]).reshape(-1, 2)
    return np.interp(peaks[:, 0], np.arange(len(times)), times), peaks[:, 1]


def find_decay_rates(times: Floats, values: Floats, window: Window) -> Floats:
    """The rates at which each peak above the level decays to the next [1/s]."""
    moments, heights = find_peaks(times, values, window)
    return -np.diff(np.log(heights)) / np.diff(moments)


def find_settling(times: Floats, values: Floats, window: Window) -> float:
    """The time from the begin of the window on after which a series stays within the band about the level, by default
    its last value [s]; NaN if it is outside at the end."""
    level = float(values[-1]) if window.level is None else window.level
    assert window.band is not None
    off = np.abs(values - level)
    outside = np.flatnonzero(off > window.band)
    if not len(outside):
        return 0.0
    last = int(outside[-1])
    if last == len(off) - 1:
        return nan
    share = (off[last] - window.band) / (off[last] - off[last + 1])
    return float(times[last] + share * (times[last + 1] - times[last]) - times[0])


MEASURES: Mapping[QuantityName, Callable[[Floats, Floats, Window], float]] = {
    "final": lambda times, values, window: values[-1],
    "max": find_max,
    "min": find_min,
    "mean": find_mean,
    "rms": find_rms,
    "amplitude": lambda *given: find_peak_to_peak(*given) / 2,
    "peak_to_peak": find_peak_to_peak,
    "crossing": find_crossing,
    "crossings": lambda times, values, window: len(
        find_crossings(times, values, window.level or 0.0, window.direction)
    ),
    "period": find_period,
    "frequency": lambda *given: 1 / find_period(*given),
    "decay_rate": find_decay_rate,
    "settling": find_settling,
}

WAVES: Mapping[QuantityName, Callable[[Floats, Floats, Window], Floats]] = {
    "period": lambda *given: np.diff(find_rises(*given)),
    "frequency": lambda *given: 1 / np.diff(find_rises(*given)),
    "decay_rate": find_decay_rates,
}
