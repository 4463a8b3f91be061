"""Draws the evidence of a verdict as SVG: lines over time, and charts."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from math import isfinite, log10
from typing import Any, NamedTuple

WIDTH, HEIGHT, LEFT, BOTTOM = 420, 220, 64, 36
COLOURS = ("#2563eb", "#d97706", "#059669", "#9333ea")
CLIPPED = 1e6
"""What is larger in a run that diverges is left out: its other points would be one line."""
PICTURES_MAX = 12


class Line(NamedTuple):
    """Points that are joined; `x` and `y` hold None where there is no value."""

    label: str
    x: Sequence[float | None]
    y: Sequence[float | None]


class Axis(NamedTuple):
    """What an axis shows."""

    label: str
    is_log: bool = False

    def place(self, value: Any) -> float | None:
        """Returns where a value is on the axis; None where it is not."""
        if not isinstance(value, int | float) or not isfinite(value) or abs(value) > CLIPPED:
            return None
        if self.is_log:
            return log10(value) if value > 0 else None
        return float(value)


def draw_evidence(evidence: Mapping[str, Any]) -> Iterator[str]:
    """Yields the pictures of a verdict as SVG. What is not of the known shape is left out."""
    try:
        yield from list(list_pictures(evidence))[:PICTURES_MAX]
    except (KeyError, TypeError, ValueError, AttributeError):
        return


def list_pictures(evidence: Mapping[str, Any]) -> Iterator[str]:
    """Yields every picture."""
    angles: dict[str, list[Mapping[str, Any]]] = {}
    for one in evidence.get("angles") or []:
        angles.setdefault(one["case"], []).append(one)
    for case, ends in angles.items():
        lines = [Line(f"{one['end']}, {one['timestep_ms']:.4g} ms", one["time_s"], one["angle"]) for one in ends]
        yield draw(case, Axis("time [s]"), Axis("angle [rad]"), lines)
    for one in evidence.get("differences") or []:
        lines = [Line(name, one["time_s"], one[name]) for name in ("qpos", "qvel")]
        yield draw(f"{one['case']}: difference", Axis("time [s]"), Axis("difference", True), lines)
    if order := evidence.get("order"):
        line = Line("error", order["timestep_ms"], order["error"])
        yield draw("order", Axis("timestep [ms]", True), Axis("error", True), [line])
    for one in evidence.get("charts") or []:
        lines = [Line(line["label"], line["x"], line["y"]) for line in one["series"]]
        yield draw(
            one["title"], Axis(one["x"]["label"], one["x"]["log"]), Axis(one["y"]["label"], one["y"]["log"]), lines
        )


def draw(title: str, across: Axis, up: Axis, lines: Sequence[Line]) -> str:
    """Returns lines over axes, with a legend."""
    placed = [
        (line.label, [(across.place(x), up.place(y)) for x, y in zip(line.x, line.y, strict=True)]) for line in lines
    ]
    points = [(x, y) for _, line in placed for x, y in line if x is not None and y is not None]
    if not points:
        return ""
    (left, right), (low, high) = (stretch([point[i] for point in points]) for i in (0, 1))

    def at(x: float, y: float) -> str:
        px = LEFT + (x - left) / (right - left) * (WIDTH - LEFT - 12)
        py = HEIGHT - BOTTOM - (y - low) / (high - low) * (HEIGHT - BOTTOM - 40)
        return f"{px:.1f},{py:.1f}"

    frame = f"{LEFT},40 {LEFT},{HEIGHT - BOTTOM} {WIDTH - 12},{HEIGHT - BOTTOM}"
    head = f'width="{WIDTH}" height="{HEIGHT}" font-size="11" fill="currentColor" font-family="sans-serif"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" {head}><title>{escape(title)}</title>',
        f'<text x="{LEFT}" y="14" font-weight="bold">{escape(title)}</text>',
        f'<polyline points="{frame}" fill="none" stroke="#888"/>',
        f'<text x="{WIDTH - 12}" y="{HEIGHT - 4}" text-anchor="end">{escape(across.label)}</text>',
        f'<text x="4" y="30">{escape(up.label)}</text>',
    ]
    for value, y in ((high, 44), (low, HEIGHT - BOTTOM)):
        parts.append(f'<text x="{LEFT - 4}" y="{y}" text-anchor="end">{write(value, up)}</text>')
    for value, x, anchor in ((left, LEFT, "start"), (right, WIDTH - 12, "end")):
        parts.append(f'<text x="{x}" y="{HEIGHT - BOTTOM + 14}" text-anchor="{anchor}">{write(value, across)}</text>')
    for index, (label, line) in enumerate(placed):
        colour = COLOURS[index % len(COLOURS)]
        joined = " ".join(at(x, y) for x, y in line if x is not None and y is not None)
        parts.append(f'<polyline points="{joined}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        parts.append(f'<text x="{LEFT + 90 + 130 * index}" y="30" fill="{colour}">{escape(label)}</text>')
    return "".join([*parts, "</svg>"])


def stretch(values: Sequence[float]) -> tuple[float, float]:
    """Returns the ends of an axis, which are never the same."""
    low, high = min(values), max(values)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def write(value: float, axis: Axis) -> str:
    """Returns an end of an axis."""
    return f"{10**value:.2g}" if axis.is_log else f"{value:.3g}"
