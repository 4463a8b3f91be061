"""The names of piles in a picture of a class: what they say, and where they stand without lying on anything else."""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace

from grader.web.text.numbers import capitalize
from grader.web.verdict.svg import estimate_width

SIGNS, SIGNS_NARROW = 34, 22
"""Signs of a line of a name."""
LINES = 3
"""Lines of a name."""
HEIGHT = 16.0
"""Height of a line."""
BESIDE = 4.0
"""Room between a name and what stands beside it."""
EDGE = 3.0
"""How far a name that begins or ends at its pile reaches beyond its middle."""
STARTS = ("Your number is ", "Your number would be ", "You ", "Your ", "The function ", "The model ", "The ", "It ")
"""What a name in a picture leaves out."""


@dataclass(frozen=True)
class Box:
    """What takes room: its middle, half its width, and its ends from the top down."""

    x: float
    half: float
    top: float
    foot: float

    def is_on(self, other: "Box") -> bool:
        """Whether two lie on each other, or nearly."""
        is_beside = abs(self.x - other.x) >= self.half + other.half + BESIDE
        return not is_beside and self.foot > other.top and other.foot > self.top


@dataclass(frozen=True)
class Label:
    """A name in its lines over a pile at the pixel `pile`, whose top is at `top`; `y` is the baseline of the last
    line."""

    lines: tuple[str, ...]
    x: float
    y: float
    pile: float
    top: float

    @property
    def box(self) -> Box:
        """The room that it takes."""
        half = max(map(estimate_width, self.lines)) / 2
        return Box(self.x, half, self.y - HEIGHT * len(self.lines) + 3, self.y + 4)

    @property
    def leader(self) -> Box:
        """The line that leads from the name to its pile; without a length where the name stands on it."""
        is_high = self.y < self.top - HEIGHT
        return Box(self.pile, 0, self.y + 5, self.top - 3 if is_high else self.y + 5)


def shorten_mistake(name: str, *, is_narrow: bool) -> tuple[str, ...]:
    """Returns a mistake's name in lines of about the same length: without whose it is and backticks, and with an
    ellipsis where the lines do not hold it."""
    name = name.replace("`", "")
    for start in STARTS:
        if name.startswith(start):
            name = capitalize(name.removeprefix(start))
            break
    most = SIGNS_NARROW if is_narrow else SIGNS
    count = min(LINES, math.ceil(len(name) / most))
    for signs in range(max(1, math.ceil(len(name) / count)), most):
        lines = textwrap.wrap(name, signs, break_long_words=False, break_on_hyphens=False)
        if len(lines) <= count and max(map(len, lines)) <= signs:
            return tuple(lines)
    lines = textwrap.wrap(name, most, max_lines=LINES, placeholder="…", break_on_hyphens=False)
    return tuple(line.replace(" …", "…") for line in lines)


def place_labels(wanted: Sequence[Label], taken: Sequence[Box], width: float, top: float, most: int) -> list[Label]:
    """Returns the labels that find room between `top` and their piles, at most so many; the first come first. `taken`
    is where something stands already."""
    placed: list[Label] = []
    for label in wanted:
        half = label.box.half
        steps = max(0, int((label.box.top - top) // HEIGHT)) + 1
        places = [min(max(x, half), width - half) for x in (label.x, label.x + EDGE - half, label.x - EDGE + half)]
        tries = [replace(label, x=x, y=label.y - HEIGHT * step) for step in range(steps) for x in places]
        names = [each.box for each in placed]
        rooms = [*taken, *names, *(each.leader for each in placed)]
        free = next(
            (
                each
                for each in tries
                if not any(each.box.is_on(room) for room in rooms)
                and not any(each.leader.is_on(name) for name in names)
            ),
            None,
        )
        if free is not None and len(placed) < most:
            placed.append(free)
    return placed
