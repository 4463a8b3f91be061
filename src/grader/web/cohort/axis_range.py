"""Which part of an axis is drawn: what lies far off stands in a pile at an end, so that the rest can be told apart."""

import math
from collections.abc import Sequence

from grader.domain.axes import ClassAxis, Position

FAR, FAR_RIGHT = 2.1, 10.0
"""On a linear axis: positions further from the limit than this factor are far off, and where they are right."""
BELOW, ABOVE = 1e6, 1e12
"""On a logarithmic axis: how many times smaller or larger than the limit a position may be."""
MARGIN, MARGIN_LOG = 0.06, 0.03


def choose_range(positions: Sequence[Position], axis: ClassAxis) -> tuple[float, float]:
    """Returns the ends of the axis: of the positions that are not far off, the limit and the marks."""
    values = [position.middle for position in positions if not position.is_none]
    known = [value for value in (*(axis.right or ()), *(mark for _, mark in axis.marks)) if math.isfinite(value)]
    return choose_log_range(values, known, axis) if axis.is_log else choose_linear_range(values, known, axis)


def choose_log_range(values: Sequence[float], known: Sequence[float], axis: ClassAxis) -> tuple[float, float]:
    """Returns the ends of a logarithmic axis, at least a decade on both sides of the limit."""
    limit = axis.limit or 1.0
    near = [value for value in values if limit / BELOW <= value <= limit * ABOVE]
    shown = [*near, *(value for value in known if value > 0), limit / 10, limit * 10]
    low, high = min(shown), max(shown)
    margin = (high / low) ** MARGIN_LOG
    return low / margin, high * margin


def choose_linear_range(values: Sequence[float], known: Sequence[float], axis: ClassAxis) -> tuple[float, float]:
    """Returns the ends of a linear axis, whose side where everything is right reaches further."""
    limit = axis.limit
    near = limit if limit is not None else sorted(values)[len(values) // 2] if values else 0.0
    if near:
        ends = sorted((near / FAR, near * FAR))
    else:
        width = 10 * max((abs(value) for value in known), default=0.0) or math.inf
        ends = [-width, width]
    low_end = near - FAR_RIGHT * abs(near) if axis.is_at_most and near else ends[0]
    high_end = near + FAR_RIGHT * abs(near) if axis.is_at_least and near else ends[1]
    shown = [*(value for value in values if low_end <= value <= high_end), *known, near]
    low, high = min(shown), max(shown)
    if axis.is_whole:
        return min(low, 0.0) - 0.5, high + 0.5
    margin = MARGIN * (high - low) or 0.1 * abs(near) or 1.0
    return low - margin, high + margin
