"""Line plots with direct labels: error against timestep with its order, error against time, and charts of any kind."""

import math
from collections.abc import Sequence
from itertools import pairwise

from grader.domain.pages.pictures import Chart, ChartAxis
from grader.web.text.numbers import capitalize, keep_unbroken, write_number, write_quantity
from grader.web.verdict.evidence import Difference, Order
from grader.web.verdict.svg import Axis, Drawing, Point, Sketch, estimate_width

HEIGHT, TOP, FOOT, LEFT = 250.0, 24.0, 44.0, 46.0
RIGHT = 12.0
MARGIN = 0.06
LINES_MAX = 8
OFF_BY = 0.3
"""An order that differs by this much counts as another one."""
INTEGRATORS = ("Euler", "RK4", "implicit", "implicitfast", "discrete")
STYLES = ("Euler", "implicitfast", "discrete", "implicit", "RK4")
"""Colours and dashes of lines that are not an integrator's."""


def make_frame(
    width: float, xs: tuple[float, float], ys: tuple[float, float], log: tuple[bool, bool]
) -> tuple[Drawing, Axis, Axis]:
    """Returns an empty plot, and its axes."""
    across = Axis(*xs, LEFT, width - RIGHT, log[0])
    return Drawing(width, HEIGHT), across, Axis(*ys, HEIGHT - FOOT, TOP, log[1])


def plot_order(order: Order) -> Sketch | None:
    """Error against timestep with the measured slope, beside what a step of the expected order would give."""
    points = [(h, e) for h, e in zip(order.timestep_ms, order.error, strict=False) if e is not None and e > 0 and h > 0]
    if len(points) < 2:
        return None
    measured = "no order" if order.slope is None else f"order {order.slope:.2f}"
    is_right = order.slope is not None and abs(order.slope - order.expected_slope) < OFF_BY
    factor = write_number(2.0 ** (order.slope or 0.0), 2)
    expected = write_number(2.0**order.expected_slope, 2)
    if is_right:
        title = f"Halve the timestep and your error falls by a factor of {factor}, as it should"
    else:
        title = f"Halve the timestep and your error falls by a factor of {factor}; it should be {expected}"
    caption = "The largest error against the exact motion, over the timestep; both axes are logarithmic."
    rows = tuple((write_quantity(h, "ms"), write_number(e, 3)) for h, e in points)
    table = (("Timestep", "Your error"), *rows)
    return Sketch("order", title, caption, table, lambda width: draw_order(order, points, measured, width))


def draw_order(order: Order, pairs: Sequence[Point], measured: str, width: float) -> Drawing:
    """Returns the measured points, and a line of the expected slope through the last of them."""
    (h0, e0) = min(pairs)
    ideal = [(h, e0 * (h / h0) ** order.expected_slope) for h, _ in pairs]
    errors = [e for _, e in (*pairs, *ideal)]
    xs = (h0 / 1.25, max(pairs)[0] * 1.25)
    picture, across, up = make_frame(width, xs, (min(errors) / 4, max(errors) * 8), (True, True))
    picture.y_axis(up, LEFT, width - RIGHT, 4)
    picture.line("axis", LEFT, HEIGHT - FOOT, width - RIGHT, HEIGHT - FOOT)
    for h, _ in pairs:
        picture.text(write_quantity(h, "ms"), across.at(h), HEIGHT - FOOT + 18, anchor="middle")
    picture.text("timestep", (LEFT + width) / 2, HEIGHT - 6, anchor="middle")
    inner = Drawing(width, HEIGHT)

    def drawn(points: Sequence[Point]) -> list[Point]:
        return [(across.at(h), up.at(e)) for h, e in points]

    inner.path("reference", drawn(ideal))
    inner.path("line", drawn(pairs))
    picture.clipped(LEFT, TOP, width - RIGHT - LEFT, HEIGHT - FOOT - TOP, inner)
    for h, e in pairs:
        picture.dot("", across.at(h), up.at(e))
    is_off = abs((order.slope or 0.0) - order.expected_slope) >= OFF_BY
    is_above = max(ideal)[1] > max(pairs)[1]
    draw_end(picture, drawn(pairs), f"yours: {measured}", is_below=is_off and is_above)
    if is_off:
        draw_end(picture, drawn(ideal), f"order {write_number(order.expected_slope)} would be", is_below=not is_above)
    return picture


def draw_end(picture: Drawing, line: Sequence[Point], caption: str, *, is_below: bool) -> None:
    """The name of a rising line at its upper end: above it, or below all of it that the name spans."""
    x, y = max(line)
    left = x - estimate_width(caption)
    lowest = max(y, *(interpolate_height(a, b, left) for a, b in pairwise(sorted(line)) if b[0] > left))
    picture.text(caption, x, lowest + 20 if is_below else y - 12, "name halo", "end")


def interpolate_height(start: Point, end: Point, x: float) -> float:
    """Returns the height of the segment between two points at `x`, or at its start if that is further right."""
    share = max(0.0, (x - start[0]) / (end[0] - start[0]))
    return start[1] + share * (end[1] - start[1])


def plot_difference(difference: Difference, name: str) -> Sketch | None:
    """Returns the distance from MuJoCo's RK4 over time, with the tolerance as a band; None if it is zero everywhere."""
    lines = {"velocities": difference.qvel, "positions": difference.qpos}
    series = {
        label: [(t, v) for t, v in zip(difference.time_s, values, strict=False) if v is not None and v > 0]
        for label, values in lines.items()
    }
    series = {label: points for label, points in series.items() if points}
    if not series:
        return None
    most = max(v for points in series.values() for _, v in points)
    within = most <= difference.tolerance
    title = "Round-off is all that parts you from MuJoCo's RK4" if within else "How far you are from MuJoCo's RK4"
    caption = f"{capitalize(keep_unbroken(name))}: the largest difference against time, on a logarithmic scale."
    rows = tuple(
        (label, write_number(max(v for _, v in points), 3), write_number(difference.tolerance))
        for label, points in series.items()
    )
    head = ("Of the", "Largest difference", "Counts as right up to")
    name = f"difference-{difference.case}"
    return Sketch(name, title, caption, (head, *rows), lambda width: draw_difference(difference, series, width))


def draw_difference(difference: Difference, series: dict[str, list[Point]], width: float) -> Drawing:
    """Both lines, and the band in which they count as right."""
    values = [v for points in series.values() for _, v in points] + [difference.tolerance]
    low, high = min(min(values) / 5, difference.tolerance / 50), max(values) * 20
    picture, across, up = make_frame(width, (0, max(difference.time_s)), (low, high), (False, True))
    passes = up.at(difference.tolerance)
    picture.box("passes", LEFT, passes, width - RIGHT - LEFT, HEIGHT - FOOT - passes)
    picture.y_axis(up, LEFT, width - RIGHT, 5)
    picture.x_axis(across, HEIGHT - FOOT, "s", 5)
    picture.text(f"counts as right: up to {write_number(difference.tolerance)}", LEFT + 6, passes + 16, "halo")
    for label, style, is_below in (("velocities", "solid", False), ("positions", "dashed", True)):
        points = series.get(label, [])
        picture.path(f"line {style}", [(across.at(t), up.at(v)) for t, v in points])
        if points:
            caption = f"{label}: up to {write_number(max(v for _, v in points), 2)}"
            # Above every velocity, or below every position, that the name spans.
            spanned = min(1.0, estimate_width(caption) / (across.end - across.start))
            reach = [v for _, v in points[-math.ceil(spanned * len(points)) :]]
            y = up.at(min(reach)) + 20 if is_below else up.at(max(reach)) - 10
            picture.text(caption, width - RIGHT - 4, y, "name halo", "end")
    return picture


def plot_chart(chart: Chart, name: str, index: int) -> Sketch | None:
    """Returns a chart that a kind of exercise asks for; None if it holds no number."""
    lines = [(series.label, select_finite(series.x, series.y, chart)) for series in chart.series[:LINES_MAX]]
    lines = [(label, points) for label, points in lines if points]
    if not lines:
        return None
    title = f"{name}: {chart.title}" if chart.title else name
    caption = f"{chart.y.label or 'Value'} against {chart.x.label or 'x'}."
    rows = [
        (label, *(f"{write_number(p[0])}: {write_number(p[1])}" for p in (points[0], points[-1])))
        for label, points in lines
    ]
    table = (("Line", "First point", "Last point"), *rows)
    return Sketch(f"chart-{index}", title, caption, table, lambda width: draw_chart(chart, lines, width))


def select_finite(xs: Sequence[float | None], ys: Sequence[float | None], chart: Chart) -> list[Point]:
    """Returns the points that can be drawn."""
    pairs = zip(xs, ys, strict=False)
    return [
        (x, y)
        for x, y in pairs
        if x is not None and y is not None and math.isfinite(x) and math.isfinite(y)
        and (x > 0 or not chart.x.log) and (y > 0 or not chart.y.log)
    ]  # fmt: skip


def choose_ends(axis: ChartAxis, values: Sequence[float]) -> tuple[float, float]:
    """Returns the ends of an axis: those that were asked for, else of the values with a margin."""
    low = axis.min if axis.min is not None else min(values)
    high = axis.max if axis.max is not None else max(values)
    if axis.log:
        low, high = max(low, 1e-300), max(high, 1e-299)
        return (low / 1.5, high * 1.5) if high > low else (low / 10, low * 10)
    if high <= low:
        return low - 0.5, low + 0.5
    margin = MARGIN * (high - low)
    return (low if axis.min is not None else low - margin), (high if axis.max is not None else high + margin)


def draw_chart(chart: Chart, lines: Sequence[tuple[str, list[Point]]], width: float) -> Drawing:
    """Lines with their names at their ends, and marked values."""
    xs = [x for _, points in lines for x, _ in points] + [mark.x for mark in chart.marks if mark.x is not None]
    ys = [y for _, points in lines for _, y in points] + [mark.y for mark in chart.marks if mark.y is not None]
    picture, across, up = make_frame(
        width, choose_ends(chart.x, xs), choose_ends(chart.y, ys), (chart.x.log, chart.y.log)
    )
    picture.y_axis(up, LEFT, width - RIGHT, 4)
    picture.x_axis(across, HEIGHT - FOOT, "", 5)
    picture.text(chart.x.label, (LEFT + width) / 2, HEIGHT - 6, anchor="middle")
    picture.text(chart.y.label, 0, 12)
    for mark in chart.marks:
        if mark.x is not None:
            picture.line("reference", across.at(mark.x), TOP, across.at(mark.x), HEIGHT - FOOT)
            picture.text(mark.label, across.at(mark.x) + 4, TOP + 12, "halo")
        if mark.y is not None:
            picture.line("reference", LEFT, up.at(mark.y), width - RIGHT, up.at(mark.y))
            picture.text(mark.label, width - RIGHT, up.at(mark.y) - 4, "halo", "end")
    inner = Drawing(width, HEIGHT)
    for index, (label, points) in enumerate(lines):
        style = label if label in INTEGRATORS else STYLES[index % len(STYLES)]
        inner.path(f"line {style}", [(across.at(x), up.at(y)) for x, y in points])
    picture.clipped(LEFT, TOP, width - RIGHT - LEFT, HEIGHT - FOOT - TOP, inner)
    y = -math.inf
    for label, points in sorted(lines, key=lambda line: up.at(line[1][-1][1])):  # in the order of the lines' ends
        y = max(y + 15, min(max(up.at(points[-1][1]) - 6, TOP + 10), HEIGHT - FOOT - 4))
        if label:
            picture.text(label, width - RIGHT - 2, y, "name halo", "end")
    return picture
