"""A drawing as SVG text: axes, lines and labels. Everything that is written into it is escaped."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape

from grader.web.text.numbers import write_number, write_power

Point = tuple[float, float]

HATCH = 8.0
"""Distance between the lines of a hatched area."""

FAR = 40.0
"""Points further outside the frame than this many times its size are moved to there: longer numbers draw the same."""


@dataclass(frozen=True)
class Axis:
    """Maps values to pixels, from `low` at `start` to `high` at `end`; on a log axis equal ratios are equally far."""

    low: float
    high: float
    start: float
    end: float
    log: bool = False

    def at(self, value: float) -> float:
        """Returns the pixel of a value; values beyond the ends lie outside, though not arbitrarily far."""
        value, low, high = (self._turned(number) for number in (value, self.low, self.high))
        span = high - low
        share = (value - low) / span if 0 < span < math.inf else 0.5
        return self.start + min(max(share, -FAR), FAR) * (self.end - self.start)

    def _turned(self, value: float) -> float:
        """Returns the value on a linear scale; zero is far below every value of a log axis."""
        return value if not self.log else math.log10(value) if value > 0 else -math.inf

    def ticks(self, about: int) -> list[float]:
        """Round values on the axis, about so many; none if its ends are too large to be told apart."""
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            return []
        return list_decades(self.low, self.high, about) if self.log else list_round_steps(self.low, self.high, about)

    def label(self, value: float) -> str:
        """Returns a tick as it is written."""
        exponent = math.log10(value) if self.log and value > 0 else 0.5
        if self.log and (self.high / self.low > 1e3 or value < 1e-3) and abs(exponent - round(exponent)) < 1e-9:
            return f"10{write_power(round(exponent))}"
        return write_number(value)


def list_round_steps(low: float, high: float, about: int) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten between `low` and `high`."""
    raw = (high - low) / max(about, 1)
    if not (raw > 0 and math.isfinite(raw)):
        return [low]
    size = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * size for factor in (1, 2, 2.5, 5, 10) if factor * size >= 0.999 * raw)
    if not (step > 0 and math.isfinite(low / step) and math.isfinite(high / step)):
        return [low]
    first = math.ceil(low / step - 1e-9)
    return [float(f"{index * step:.10g}") for index in range(first, math.floor(high / step + 1e-9) + 1)]


def list_decades(low: float, high: float, about: int) -> list[float]:
    """Powers of ten between `low` and `high`; where these are fewer than three, also 2 and 5 times such."""
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    stride = max(1, math.ceil((last - first) / max(about, 1)))
    decades = [10.0**power for power in range(first, last + 1, stride)]
    if len(decades) > 2:
        return decades
    steps = [factor * 10.0**power for power in range(first - 1, last + 1) for factor in (1, 2, 5)]
    steps = [float(f"{step:.10g}") for step in steps if low <= step <= high]
    return steps if 3 <= len(steps) <= about + 2 else list_round_steps(low, high, about)


@dataclass
class Drawing:
    """Collects the elements of one picture of `width` by `height` units; fonts are 13 units high."""

    width: float
    height: float
    parts: list[str] = field(default_factory=list)

    def line(self, kind: str, x1: float, y1: float, x2: float, y2: float) -> None:
        """A straight line of a class."""
        self.path(kind, [(x1, y1), (x2, y2)])

    def path(self, kind: str, points: Sequence[Point]) -> None:
        """A line of a class through points."""
        self.paths(kind, [points] if points else [])

    def paths(self, kind: str, lines: Sequence[Sequence[Point]]) -> None:
        """Lines of a class as one element."""
        if lines:
            self.parts.append(f'<path class="{kind}" d="{format_path(lines)}"/>')

    def box(self, kind: str, x: float, y: float, width: float, height: float) -> None:
        """A filled rectangle of a class."""
        if width > 0 and height > 0:
            self.parts.append(
                f'<rect class="{kind}" x="{trim(x)}" y="{trim(y)}" width="{trim(width)}" height="{trim(height)}"/>'
            )

    def hatch(self, kind: str, x: float, y: float, width: float, height: float) -> None:
        """Slanted lines that fill a rectangle."""
        lines = []
        for index in range(math.ceil((width + height) / HATCH)):
            foot = x + index * HATCH - height  # where the line would meet the bottom
            left, right = max(foot, x), min(foot + height, x + width)
            if right > left:
                low, high = y + height - (left - foot), y + height - (right - foot)
                lines.append([(left, low), (right, high)])
        self.paths(kind, lines)

    def dot(self, kind: str, x: float, y: float) -> None:
        """A measured point."""
        self.parts.append(f'<circle class="dot {kind}" cx="{trim(x)}" cy="{trim(y)}" r="3.5"/>')

    def cross(self, x: float, y: float) -> None:
        """The mark where a run ends."""
        self.parts.append(f'<path class="cross" d="M{trim(x - 4)} {trim(y - 4)}l8 8m0 -8l-8 8"/>')

    def text(self, text: str, x: float, y: float, kind: str = "", anchor: str = "start") -> None:
        """A label, kept within the picture by its estimated width."""
        room = estimate_width(text)
        if anchor == "start":
            x = max(0.0, min(x, self.width - room))
        elif anchor == "end":
            x = min(self.width, max(x, room))
        else:
            x = min(max(x, room / 2), self.width - room / 2)
        where = "" if anchor == "start" else f' text-anchor="{anchor}"'
        named = f' class="{kind}"' if kind else ""
        self.parts.append(f'<text{named} x="{trim(x)}" y="{trim(y)}"{where}>{escape(text)}</text>')

    def clipped(self, x: float, y: float, width: float, height: float, inner: "Drawing") -> None:
        """Adds what another drawing holds, cut off at a frame."""
        frame = f'x="{trim(x)}" y="{trim(y)}" width="{trim(width)}" height="{trim(height)}"'
        view = f'viewBox="{trim(x)} {trim(y)} {trim(width)} {trim(height)}"'
        self.parts.append(f"<svg {frame} {view}>{''.join(inner.parts)}</svg>")

    def x_axis(self, axis: Axis, y: float, unit: str, about: int = 5) -> None:
        """Ticks with labels under a line at height `y`; the last one carries the unit."""
        self.line("axis", axis.start, y, axis.end, y)
        ticks = axis.ticks(about)
        for tick in ticks:
            x = axis.at(tick)
            self.line("axis", x, y, x, y + 4)
            label = f"{axis.label(tick)} {unit}" if tick == ticks[-1] and unit else axis.label(tick)
            self.text(label, x, y + 18, anchor="middle")

    def y_axis(self, axis: Axis, left: float, right: float, about: int = 4) -> None:
        """Grid lines from `left` to `right` with their values before them."""
        for tick in axis.ticks(about):
            y = axis.at(tick)
            self.line("grid", left, y, right, y)
            self.text(axis.label(tick), left - 6, y + 4, anchor="end")

    def svg(self, kind: str, described: str) -> str:
        """Writes the whole picture."""
        label = f'role="img" aria-label="{escape(described)}"'
        box = f"0 0 {trim(self.width)} {trim(self.height)}"
        return f'<svg class="plot {kind}" viewBox="{box}" {label}>{"".join(self.parts)}</svg>'


@dataclass(frozen=True)
class Sketch:
    """A plot before it is drawn at each width: `name` is the part of its address for the download, `table` says the
    same in words, a row of headings first."""

    name: str
    title: str
    caption: str
    table: Sequence[tuple[str, ...]]
    draw: Callable[[float], Drawing]


def estimate_width(text: str) -> float:
    """Returns the estimated width of a label."""
    return 6.9 * len(text)


def format_path(lines: Sequence[Sequence[Point]]) -> str:
    """Returns the data of a path through the points of each line. Each point is given relative to the one before it, in
    whole tenths, so that no rounding errors accumulate. Compressed, the plots of a page take 60 % of the bytes that
    absolute coordinates take."""
    at, pieces = (0, 0), []
    for line in lines:
        distances = []
        for x, y in line:
            to = round(10 * x), round(10 * y)
            distances.append(f"{trim((to[0] - at[0]) / 10)} {trim((to[1] - at[1]) / 10)}")
            at = to
        pieces.append("l".join(("m" + distances[0], " ".join(distances[1:]))).removesuffix("l"))
    return "".join(pieces).replace(" -", "-")


def trim(value: float) -> str:
    """Returns a coordinate to a tenth of a unit."""
    digits = f"{value:.1f}".removesuffix(".0")
    return "0" if digits == "-0" else digits
