"""The class on one axis: a dot for each learner's newest claim, named piles, and arrows from where claims moved."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from markupsafe import Markup

from grader.courses.reporting.class_answers import ClassAnswers, ClassAttempt
from grader.courses.rules.claims import Claim, ClaimAxis
from grader.web.text.numbers import capitalize, quantity
from grader.web.text.numbers import number as write
from grader.web.verdict.svg import Axis, Drawing, estimate_width, trim

TOP, BAND, FOOT, ARCS = 64.0, 20.0, 30.0, 46.0
"""Room above the piles for names, heights of the band and of the ticks, and room for the arrows below."""
DOT, STACK = 13.0, 200.0
"""Diameter of a dot with its gap, and the height of the highest pile."""
SIDE = 30.0
FAR = 2.1
"""Claims further from the right value than this factor stand in a pile at the end of the axis."""
NAME, NAME_NARROW = 40, 24
"""Signs of a pile's name."""
LINE, LINES = 17.0, 3
"""Height of a name, and how many may stand above each other."""
NAMED_MAX = 4
ARROWS_MAX = 40
LINKS_MAX = 80
"""Learners whose dots are links; of more the table alone has them."""
WIDE, SMALL = 1120.0, 308.0

Address = Callable[[ClassAttempt], str]


@dataclass(frozen=True)
class Dot:
    """A learner's newest claim. `before` is the first one, where that lay elsewhere."""

    attempt: ClassAttempt
    claim: Claim
    is_solved: bool
    before: Claim | None
    is_own: bool = False


@dataclass(frozen=True)
class ClassPlot:
    """The picture at both widths, with a table that says the same."""

    title: str
    caption: str
    pictures: Markup
    table: Sequence[tuple[str, str, str]]
    near: int
    """Claims that are right on this axis."""
    claims: int


@dataclass(frozen=True)
class View:
    """Who looks: where a dot leads to, if anywhere, and of how many learners a pile is at least that has a name."""

    address: Address | None
    named_from: int


@dataclass(frozen=True)
class Canvas:
    """A picture under way: its axis, where the band begins, and the height of a dot."""

    drawing: Drawing
    axis: ClaimAxis
    across: Axis
    base: float
    gap: float


def list_dots(answers: ClassAnswers, axis: ClaimAxis, own: str = "") -> list[Dot]:
    """Returns the dots of an axis; `own` is the learner who looks."""
    dots = []
    for learner, theirs in answers.by_learner.items():
        claimed = [(one, one.claims[axis.id]) for one in theirs if axis.id in one.claims]
        if not claimed:
            continue
        (_, first), (newest, last) = claimed[0], claimed[-1]
        before = first if len(claimed) > 1 and not first.is_none and first != last else None
        dots.append(Dot(newest, last, learner in answers.solved, before, learner == own))
    return dots


def draw_class(
    answers: ClassAnswers, axis: ClaimAxis, *, address: Address | None = None, own: str = "", named_from: int = 1
) -> ClassPlot:
    """Draws the claims of a class. With an `address` each dot leads to its answer, and bears the learner's name.
    Without one nothing tells whose it is, and there are no arrows. Smaller piles than `named_from` have no name."""
    dots = list_dots(answers, axis, own)
    near = sum(axis.accepts(dot.claim) for dot in dots)
    title = f"{axis.title}: where each learner says it lies" if axis.is_limit else f"{axis.title} of each learner"
    caption = "One dot is the newest claim of one learner: full where the exercise is solved, hollow where it is not."
    low, high = choose_range(dots, axis)
    if any(dot.claim.is_none or not low <= dot.claim.middle <= high for dot in dots):
        caption += (
            " Claims that lie further off stand at the ends; at the right stands who said that there is no limit."
        )
    if address is not None and any(dot.before for dot in dots):
        caption += " Arrows show how claims moved."
    view, widths = View(address, named_from), {"wide-plot": WIDE, "narrow-plot": SMALL}
    pictures = Markup().join(draw(dots, axis, width, kind, view) for kind, width in widths.items())
    table = [
        (dot.attempt.name, write_claim(dot.claim, axis), describe_mistake(dot)) for dot in sorted(dots, key=sort_key)
    ]
    return ClassPlot(title, caption, pictures, table, near, len(dots))


def sort_key(dot: Dot) -> tuple[bool, float, str]:
    """Sorts dots from the left; those who said that there is no limit come last."""
    return dot.claim.is_none, 0.0 if dot.claim.is_none else dot.claim.middle, dot.attempt.name


def write_claim(claim: Claim, axis: ClaimAxis) -> str:
    """Returns a claim in words."""
    if claim.is_none:
        return "no limit"
    if claim.low == claim.high:
        return quantity(claim.low, axis.unit) if axis.unit else write(claim.low)
    return f"{write(claim.low)} to {quantity(claim.high, axis.unit)}"


def describe_mistake(dot: Dot) -> str:
    """Says what became of the answer."""
    if dot.attempt.mistake is None:
        return "right" if dot.attempt.is_right else ""
    return dot.attempt.mistake.name


def choose_range(dots: Sequence[Dot], axis: ClaimAxis) -> tuple[float, float]:
    """Returns the ends of the axis: of the claims that are not far off, the right value and the marks."""
    values = [dot.claim.middle for dot in dots if not dot.claim.is_none]
    known = [*(axis.right or ()), *(value for _, value in axis.marks)]
    near = sum(axis.right) / 2 if axis.right else sorted(values)[len(values) // 2] if values else 0.0
    if near > 0:
        values = [value for value in values if near / FAR <= value <= near * FAR]
    low, high = min([*values, *known, near]), max([*values, *known, near])
    margin = 0.06 * (high - low) or 0.1 * abs(near) or 1.0
    return low - margin, high + margin


def draw(dots: Sequence[Dot], axis: ClaimAxis, width: float, kind: str, view: View) -> Markup:
    """Returns the picture at one width."""
    across = Axis(*choose_range(dots, axis), SIDE, width - SIDE)
    piles = stack(dots, axis, across)
    most = max(map(len, piles.values()), default=1)
    gap = min(DOT, STACK / most)
    base = TOP + gap * most + 4
    has_arrows = view.address is not None and any(dot.before for dot in dots)
    drawing = Drawing(width, base + BAND + FOOT + (ARCS if has_arrows else 0))
    canvas = Canvas(drawing, axis, across, base, gap)
    draw_band(canvas)
    draw_marks(canvas)
    name_piles(canvas, piles, view.named_from)
    address = view.address if len(dots) <= LINKS_MAX else None
    for x, pile in piles.items():
        for place, dot in enumerate(pile):
            at = (x, base - gap * (place + 0.5) - 2)
            drawing.parts.append(write_dot(dot, axis, at, gap / 2 - 1, address))
    if has_arrows:
        draw_arrows(drawing, dots, across, base + BAND + FOOT)
    label = f"{axis.title}: {len(dots)} claims. The table below has each."
    box = f"0 0 {trim(drawing.width)} {trim(drawing.height)}"
    role = "img" if address is None else "group"
    text = f'<svg class="plot class-plot {kind}" viewBox="{box}" role="{role}" aria-label="{escape(label)}">'
    return Markup(f"{text}{''.join(drawing.parts)}</svg>")  # noqa: S704  # escaped by Drawing and write_dot


def stack(dots: Sequence[Dot], axis: ClaimAxis, across: Axis) -> dict[float, list[Dot]]:
    """Returns the dots by the pixel of their pile; claims beyond an end stand at that end, solved ones below."""
    piles: dict[float, list[Dot]] = {}
    origin = across.start
    if axis.right is not None:  # a bracket stands on its side of a limit, a right number on its line
        origin = across.at(axis.right[0]) + DOT / 2 if axis.is_limit else across.at(sum(axis.right) / 2)
    ordered = sorted(dots, key=lambda dot: (not dot.is_solved, describe_mistake(dot)))
    for dot in ordered:
        at = across.end + SIDE / 2 if dot.claim.is_none else across.at(dot.claim.middle)
        at = min(max(at, across.start - SIDE / 2), across.end + SIDE / 2)
        piles.setdefault(DOT * round((at - origin) / DOT) + origin, []).append(dot)
    return dict(sorted(piles.items()))


def draw_band(canvas: Canvas) -> None:
    """The band below the piles: stable and growing for a limit, accepted for a number; then the ticks."""
    drawing, axis, across, base = canvas.drawing, canvas.axis, canvas.across, canvas.base
    low, high = axis.right or (math.nan, math.nan)
    if axis.right and axis.is_limit:
        drawing.box("stable", across.start, base, across.at(low) - across.start, BAND)
        drawing.hatch("grows", across.at(low), base, across.end - across.at(low), BAND)
        if across.at(low) - across.start > 60:
            drawing.text("stable", across.start + 6, base + 15, "told")
        if across.end - across.at(low) > 60:
            drawing.text("grows", across.end - 6, base + 15, "told halo", "end")
    elif axis.right:
        drawing.box("shade", across.start, base, across.end - across.start, BAND)
        drawing.box("passes", across.at(low), base, max(across.at(high) - across.at(low), 3), BAND)
    drawing.x_axis(across, base + BAND, axis.unit, 8 if drawing.width > 500 else 4)


def draw_marks(canvas: Canvas) -> None:
    """The right value, and the values with names."""
    drawing, axis, across, base = canvas.drawing, canvas.axis, canvas.across, canvas.base
    for name, value in axis.marks:
        x = across.at(value)
        drawing.line("reference", x, 34, x, base + BAND)
        is_right_of = axis.right is not None and value > axis.right[0]
        drawing.text(name, x - 4 if is_right_of else x + 4, 28, "halo", "start" if is_right_of else "end")
    if axis.right:
        low, high = axis.right
        value = low if axis.is_limit else (low + high) / 2
        x = across.at(value)
        said = f"{'limit' if axis.is_limit else 'right'} {quantity(value, axis.unit) if axis.unit else write(value)}"
        drawing.line("limit", x, 18, x, base + BAND)
        drawing.text(said, x - 6, 12, "name halo", "end" if x - estimate_width(said) > 0 else "start")


def name_piles(canvas: Canvas, piles: Mapping[float, list[Dot]], named_from: int) -> None:
    """Writes the commonest mistake above each pile that lies off the right value, those of most learners first; a line
    leads to the axis where a name stands. Names that would lie on others are left out."""
    drawing, axis, base = canvas.drawing, canvas.axis, canvas.base
    taken: list[tuple[float, float, float]] = []
    off = [(x, [dot for dot in pile if not axis.accepts(dot.claim)]) for x, pile in piles.items()]
    named = 0
    for x, pile in sorted(off, key=lambda one: -len(one[1])):
        names = Counter(name_dot(dot) for dot in pile)
        if len(pile) < named_from or not names or named >= (NAMED_MAX if drawing.width > 500 else 2):
            continue
        said = shorten(names.most_common(1)[0][0], NAME if drawing.width > 500 else NAME_NARROW)
        half = estimate_width(said) / 2
        centre = min(max(x, half), drawing.width - half)
        lowest = base - canvas.gap * len(piles[x]) - 12
        free = [
            y for y in (lowest - LINE * line for line in range(LINES))
            if not any(abs(centre - at) < half + room and abs(y - height) < LINE for at, room, height in taken)
        ]  # fmt: skip
        if not free:
            continue
        y = free[0]
        taken.append((centre, half, y))
        drawing.text(said, centre, y, "halo", "middle")
        drawing.line("reference", x, base, x, base + BAND)
        named += 1


def name_dot(dot: Dot) -> str:
    """Returns the name of a wrong claim."""
    return "said: no limit" if dot.claim.is_none else describe_mistake(dot)


def shorten(name: str, most: int) -> str:
    """Returns a mistake's name for a picture: without whose it is, and cut at a word to at most so many signs."""
    for start in ("Your number is ", "Your number would be ", "You ", "Your ", "The function "):
        name = name.removeprefix(start)
    name = capitalize(name)
    if len(name) <= most:
        return name
    return f"{name[: most - 1].rpartition(' ')[0] or name[: most - 1]}…"


def write_dot(dot: Dot, axis: ClaimAxis, at: tuple[float, float], radius: float, address: Address | None) -> str:
    """Returns one dot; with an address it is a link that says whose it is."""
    kind = "person" + (" solved" if dot.is_solved else "") + (" own" if dot.is_own else "")
    circle = f'<circle class="{kind}" cx="{trim(at[0])}" cy="{trim(at[1])}" r="{trim(max(radius - 0.5, 1.0))}"/>'
    if address is None:
        return circle
    state = "solved" if dot.is_solved else "not solved"
    said = escape(f"{dot.attempt.name}: {write_claim(dot.claim, axis)}, {state}")
    return f'<a href="{escape(address(dot.attempt))}" aria-label="{said}"><title>{said}</title>{circle}</a>'


def draw_arrows(drawing: Drawing, dots: Sequence[Dot], across: Axis, top: float) -> None:
    """Draws an arc from each learner's first claim to the newest, the longest ones; a head says which way."""
    moves = []
    for dot in dots:
        if dot.before is not None and not dot.claim.is_none:
            ends = [min(max(across.at(one.middle), across.start), across.end) for one in (dot.before, dot.claim)]
            if abs(ends[1] - ends[0]) > 2 * DOT:
                moves.append((ends[0], ends[1]))
    for start, end in sorted(moves, key=lambda one: -abs(one[1] - one[0]))[:ARROWS_MAX]:
        depth = min(ARCS - 8, 10 + abs(end - start) / 8)
        way = 1 if end > start else -1
        curve = f"M{trim(start)} {trim(top)}Q{trim((start + end) / 2)} {trim(top + depth)} {trim(end)} {trim(top)}"
        head = f"M{trim(end - way * 7)} {trim(top)}L{trim(end)} {trim(top)}L{trim(end - way * 2)} {trim(top + 7)}"
        drawing.parts.append(f'<path class="move" d="{curve}{head}"/>')
