"""The class on one axis: a dot for each learner's newest answer, named piles, and arrows from where answers moved."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from markupsafe import Markup

from grader.courses.reporting.class_answers import ClassAnswers, ClassAttempt
from grader.courses.rules.mistakes import OTHER
from grader.domain.axes import ClassAxis, Position
from grader.web.cohort.axis_range import choose_range
from grader.web.cohort.axis_words import UNIT_SIGNS, describe_axis, name_line, write_position
from grader.web.cohort.pile_names import HEIGHT, Box, Label, place_labels, shorten_mistake
from grader.web.verdict.svg import Axis, Drawing, estimate_width, trim

TOP, BAND, FOOT, ARCS = 64.0, 20.0, 30.0, 46.0
"""Room above the piles for names, heights of the band and of the ticks, and room for the arrows below."""
DOT, STACK = 13.0, 200.0
"""Diameter of a dot with its gap, and the height of the highest pile."""
SIDE, APART = 30.0, 36.0
"""Room beside the axis, and how far from its end those without a number stand."""
NAMED_MAX, NAMED_NARROW = 5, 3
"""Piles that have a name, in a wide picture and in a narrow one."""
ARROWS_MAX = 40
HEAD, OPENING = 8.0, 0.45
"""Length of an arrow's head, and half its angle [rad]."""
LINKS_MAX = 80
"""Learners whose dots are links; of more the table alone has them."""
WIDE, SMALL = 1120.0, 308.0
NARROW_BELOW = 500.0
NAMES_TOP, LIMIT_FOOT = 16.0, 20.0
"""How high names of piles may stand, and how far down the limit's name reaches, with room below it."""

Address = Callable[[ClassAttempt], str]


@dataclass(frozen=True)
class Dot:
    """A learner's newest claim. `before` is the first one, where that lay elsewhere."""

    attempt: ClassAttempt
    position: Position
    is_solved: bool
    before: Position | None
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
    axis: ClassAxis
    across: Axis
    base: float
    gap: float


def list_dots(answers: ClassAnswers, axis: ClassAxis, own: str = "") -> list[Dot]:
    """Returns the dots of an axis; `own` is the learner who looks."""
    dots = []
    for learner, theirs in answers.by_learner.items():
        claimed = [(attempt, attempt.positions[axis.id]) for attempt in theirs if axis.id in attempt.positions]
        if not claimed:
            continue
        (_, first), (newest, last) = claimed[0], claimed[-1]
        before = first if len(claimed) > 1 and not first.is_none and first != last else None
        dots.append(Dot(newest, last, learner in answers.solved, before, learner == own))
    return dots


def draw_class(
    answers: ClassAnswers, axis: ClassAxis, *, address: Address | None = None, own: str = "", named_from: int = 1
) -> ClassPlot:
    """Draws the answers of a class. With an `address` each dot leads to its answer, and bears the learner's name.
    Without one nothing tells whose it is, and there are no arrows. Smaller piles than `named_from` have no name."""
    dots = list_dots(answers, axis, own)
    near = sum(axis.accepts(dot.position) for dot in dots)
    view, widths = View(address, named_from), {"wide-plot": WIDE, "narrow-plot": SMALL}
    pictures = Markup().join(draw(dots, axis, width, kind, view) for kind, width in widths.items())
    table = [
        (dot.attempt.name, write_position(dot.position, axis), describe_mistake(dot))
        for dot in sorted(dots, key=sort_key)
    ]
    caption = write_caption(dots, axis, has_arrows='class="move"' in pictures)
    return ClassPlot(describe_axis(axis), caption, pictures, table, near, len(dots))


def write_caption(dots: Sequence[Dot], axis: ClassAxis, *, has_arrows: bool) -> str:
    """Says what is to be seen, and what stands where it does not lie."""
    caption = "One dot is the newest answer of one learner that has a place here: full where it is right, else hollow."
    low, high = choose_range([dot.position for dot in dots], axis)
    numbers = [dot.position.middle for dot in dots if not dot.position.is_none]
    if any(value > high or (value < low and not axis.is_log) for value in numbers):
        caption += " What lies further off stands at the ends."
    if len(numbers) < len(dots):
        caption += f" At the right end, apart: {axis.none}."
    caption += f" {axis.note}" if axis.note else ""
    return caption + (" Arrows show how answers moved." if has_arrows else "")


def sort_key(dot: Dot) -> tuple[bool, float, str]:
    """Sorts dots from the left; those who said that there is no limit come last."""
    return dot.position.is_none, 0.0 if dot.position.is_none else dot.position.middle, dot.attempt.name


def describe_mistake(dot: Dot) -> str:
    """Says what became of the answer."""
    if dot.attempt.mistake is None:
        return "right" if dot.attempt.is_right else ""
    return dot.attempt.mistake.name


def draw(dots: Sequence[Dot], axis: ClassAxis, width: float, kind: str, view: View) -> Markup:
    """Returns the picture at one width."""
    has_none = any(dot.position.is_none for dot in dots)
    ends = choose_range([dot.position for dot in dots], axis)
    has_zero = axis.is_log and any(dot.position.middle < ends[0] for dot in dots)
    left, right = SIDE + (APART - SIDE / 2 if has_zero else 0), width - SIDE - (APART - SIDE / 2 if has_none else 0)
    across = Axis(*ends, left, right, axis.is_log)
    piles = stack(dots, axis, across)
    most = max(map(len, piles.values()), default=1)
    gap = min(DOT, STACK / most)
    base = TOP + gap * most + 4
    moves = [] if view.address is None else list_moves(dots, axis, across)
    drawing = Drawing(width, base + BAND + FOOT + (ARCS if moves else 0))
    canvas = Canvas(drawing, axis, across, base, gap)
    draw_band(canvas)
    if has_zero:
        drawing.text("≈ 0", left - APART, base + BAND + 18, anchor="middle")
    taken = draw_marks(canvas)
    name_piles(canvas, piles, taken, view.named_from)
    address = view.address if len(dots) <= LINKS_MAX else None
    for x, pile in piles.items():
        for place, dot in enumerate(pile):
            at = (x, base - gap * (place + 0.5) - 2)
            drawing.parts.append(write_dot(dot, axis, at, gap / 2 - 1, address))
    draw_arrows(drawing, moves, base + BAND + FOOT)
    label = f"{describe_axis(axis)}: {len(dots)} learners. The table below has each."
    box = f"0 0 {trim(drawing.width)} {trim(drawing.height)}"
    role = "img" if address is None else "group"
    text = f'<svg class="plot class-plot {kind}" viewBox="{box}" role="{role}" aria-label="{escape(label)}">'
    return Markup(f"{text}{''.join(drawing.parts)}</svg>")  # noqa: S704  # escaped by Drawing and write_dot


def stack(dots: Sequence[Dot], axis: ClassAxis, across: Axis) -> dict[float, list[Dot]]:
    """Returns the dots by the pixel of their pile; positions beyond an end stand at that end, solved ones below."""
    piles: dict[float, list[Dot]] = {}
    for dot in sorted(dots, key=lambda dot: (not dot.is_solved, describe_mistake(dot))):
        piles.setdefault(find_pile(dot.position, axis, across), []).append(dot)
    return dict(sorted(piles.items()))


def find_pile(position: Position, axis: ClassAxis, across: Axis) -> float:
    """Returns the pixel of a position's pile: apart from the axis without a number, and on a logarithmic one for 0."""
    if position.is_none:
        return across.end + APART
    if axis.is_log and position.middle < across.low:
        return across.start - APART
    origin = across.start
    if axis.limit is not None:  # a bracket stands on its side of a limit, a right number on its line
        is_side = axis.is_limit or axis.is_at_most or axis.is_at_least
        origin = across.at(axis.limit) + (DOT / 2 if is_side and not axis.is_whole else 0)
    if axis.is_whole and across.at(1) - across.at(0) >= DOT:
        return across.at(position.middle)
    at = min(max(across.at(position.middle), across.start - SIDE / 2), across.end + SIDE / 2)
    step, side = round((at - origin) / DOT), choose_side(position, axis)
    if side:  # `origin` is the first pile beyond the line
        step = min(step, -1) if side < 0 else max(step, 0)
    return DOT * step + origin


def choose_side(position: Position, axis: ClassAxis) -> int:
    """Returns on which side of the limit's line a number has to stand, -1 or 1; 0 where it may stand on it."""
    if axis.limit is None or axis.is_limit or axis.is_whole or not (axis.is_at_most or axis.is_at_least):
        return 0
    is_below = position.middle <= axis.limit if axis.is_at_most else position.middle < axis.limit
    return -1 if is_below else 1


def draw_band(canvas: Canvas) -> None:
    """The band below the piles: stable and growing for a limit, accepted for a number; then the ticks."""
    drawing, axis, across, base = canvas.drawing, canvas.axis, canvas.across, canvas.base
    if axis.right is not None:
        left, right = (min(max(across.at(value), across.start), across.end) for value in axis.right)
        if axis.is_limit:
            drawing.box("stable", across.start, base, left - across.start, BAND)
            drawing.hatch("grows", left, base, across.end - left, BAND)
            write_sides(canvas, left, ("stable", "grows"))
        else:
            drawing.box("shade", across.start, base, across.end - across.start, BAND)
            drawing.box("passes", left, base, max(right - left, 3), BAND)
            if axis.is_at_most or axis.is_at_least:
                sides = ("accepted", "" if axis.note else "not accepted")
                write_sides(canvas, right if axis.is_at_most else left, sides if axis.is_at_most else sides[::-1])
    if axis.is_whole:
        write_whole_ticks(canvas)
    else:
        unit = axis.unit if len(axis.unit) <= UNIT_SIGNS else ""
        drawing.x_axis(across, base + BAND, unit, 8 if drawing.width > NARROW_BELOW else 4)


def write_sides(canvas: Canvas, limit: float, labels: tuple[str, str]) -> None:
    """Writes into the band what is on both sides of the limit, where there is room."""
    across, y = canvas.across, canvas.base + 15
    if labels[0] and limit - across.start > estimate_width(labels[0]) + 12:
        canvas.drawing.text(labels[0], across.start + 6, y, "told halo")
    if labels[1] and across.end - limit > estimate_width(labels[1]) + 12:
        canvas.drawing.text(labels[1], across.end - 6, y, "told halo", "end")


def write_whole_ticks(canvas: Canvas) -> None:
    """Writes whole numbers below the band."""
    drawing, across, y = canvas.drawing, canvas.across, canvas.base + BAND
    drawing.line("axis", across.start, y, across.end, y)
    last = math.floor(across.high)
    step = max(1, math.ceil(last / (16 if drawing.width > NARROW_BELOW else 7)))
    for value in range(last, -1, -step):
        x = across.at(value)
        drawing.line("axis", x, y, x, y + 4)
        drawing.text(str(value), x, y + 18, anchor="middle")


def draw_marks(canvas: Canvas) -> list[Box]:
    """The limit, and the values with names; returns where these names stand."""
    drawing, axis, across, base = canvas.drawing, canvas.axis, canvas.across, canvas.base
    taken = []
    for name, value in axis.marks:
        x = across.at(value)
        drawing.line("reference", x, 34, x, base + BAND)
        is_right_of = axis.limit is not None and value > axis.limit
        drawing.text(name, x - 4 if is_right_of else x + 4, 28, "halo", "start" if is_right_of else "end")
        half = estimate_width(name) / 2
        middle = min(max(x + (half if is_right_of else -half), half), drawing.width - half)
        taken += [Box(middle, half, 15, 32), Box(x, 0, 34, base)]
    if axis.limit is not None:
        x, label = across.at(axis.limit), name_line(axis)
        drawing.line("limit", x, 18, x, base + BAND)
        half = estimate_width(label) / 2
        is_left_of = x - 2 * half > 0
        drawing.text(label, x - 6, 12, "name halo", "end" if is_left_of else "start")
        taken.append(Box(x - 6 + (-half if is_left_of else half), half, 0, LIMIT_FOOT))
    return taken


def name_piles(canvas: Canvas, piles: Mapping[float, list[Dot]], taken: Sequence[Box], named_from: int) -> None:
    """Writes the commonest mistake above each pile that is wrong, those of most learners first; a line leads from a
    name that stands higher. Names that would lie on others are left out."""
    drawing, axis, base = canvas.drawing, canvas.axis, canvas.base
    is_narrow = drawing.width < NARROW_BELOW
    tops = {x: base - canvas.gap * len(pile) - 2 for x, pile in piles.items()}
    wanted: dict[tuple[str, ...], Label] = {}
    off = [(x, [dot for dot in pile if not axis.accepts(dot.position)]) for x, pile in piles.items()]
    for x, wrong in sorted(off, key=lambda pair: -len(pair[1])):
        names = Counter(filter(None, (name_dot(dot, axis) for dot in wrong)))
        if len(wrong) >= named_from and 2 * len(wrong) >= len(piles[x]) and names:
            lines = shorten_mistake(names.most_common(1)[0][0], is_narrow=is_narrow)
            wanted.setdefault(
                lines, Label(lines, x, tops[x] - 8, x, tops[x])
            )  # a name that several piles have stands once
    rooms = [*taken, *(Box(x, DOT / 2, top, base) for x, top in tops.items())]
    if axis.limit is not None:
        rooms.append(Box(canvas.across.at(axis.limit), 0, 0, base))
    most = NAMED_NARROW if is_narrow else NAMED_MAX
    labels = place_labels([*wanted.values()], rooms, drawing.width, NAMES_TOP, most)
    for label in labels:
        if label.leader.foot > label.leader.top:
            drawing.line("reference", label.pile, label.leader.top, label.pile, label.leader.foot)
    for label in labels:
        for place, line in enumerate(reversed(label.lines)):
            drawing.text(line, label.x, label.y - HEIGHT * place, "halo", "middle")


def name_dot(dot: Dot, axis: ClassAxis) -> str:
    """Returns the name of a wrong answer."""
    if dot.position.is_none:
        return f"said: {axis.none}" if axis.is_limit else axis.none
    mistake = describe_mistake(dot)
    return write_position(dot.position, axis) if mistake == OTHER else mistake


def write_dot(dot: Dot, axis: ClassAxis, at: tuple[float, float], radius: float, address: Address | None) -> str:
    """Returns one dot; with an address it is a link that says whose it is."""
    kind = "person" + (" solved" if dot.is_solved else "") + (" own" if dot.is_own else "")
    circle = f'<circle class="{kind}" cx="{trim(at[0])}" cy="{trim(at[1])}" r="{trim(max(radius - 0.5, 1.0))}"/>'
    if address is None:
        return circle
    state = "solved" if dot.is_solved else "not solved"
    label = escape(f"{dot.attempt.name}: {write_position(dot.position, axis)}, {state}")
    return f'<a href="{escape(address(dot.attempt))}" aria-label="{label}"><title>{label}</title>{circle}</a>'


def list_moves(dots: Sequence[Dot], axis: ClassAxis, across: Axis) -> list[tuple[float, float]]:
    """Returns from which pile to which the learners moved, between first answer and newest: the longest ways."""
    ends = [
        [find_pile(position, axis, across) for position in (dot.before, dot.position)]
        for dot in dots
        if dot.before is not None
    ]
    moves = [(start, end) for start, end in ends if abs(end - start) > 2 * DOT]
    return sorted(moves, key=lambda move: -abs(move[1] - move[0]))[:ARROWS_MAX]


def draw_arrows(drawing: Drawing, moves: Sequence[tuple[float, float]], top: float) -> None:
    """Draws an arc for each move; a head says which way."""
    for start, end in moves:
        depth = min(2 * (ARCS - 8), 20 + abs(end - start) / 4)  # a quadratic curve goes half as deep
        middle = (start + end) / 2
        curve = f"M{trim(start)} {trim(top)}Q{trim(middle)} {trim(top + depth)} {trim(end)} {trim(top)}"
        back = math.atan2(depth, middle - end)
        head = [
            (end + HEAD * math.cos(back + turn), top + HEAD * math.sin(back + turn)) for turn in (-OPENING, OPENING)
        ]
        tips = "L".join(f"{trim(x)} {trim(y)}" for x, y in (head[0], (end, top), head[1]))
        drawing.parts.append(f'<path class="move" d="{curve}M{tips}"/>')
