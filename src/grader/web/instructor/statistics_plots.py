"""Small plots of a quiz's statistics: each question's estimates with their intervals, and bars beside words."""

from collections.abc import Iterator, Mapping, Sequence

from markupsafe import Markup

from grader.courses.rules.statistics import Estimate, QuestionStatistics
from grader.web.text.numbers import NARROW, write_number
from grader.web.verdict.svg import Axis, Drawing, Sketch, trim

ROW, FOOT, SIDE = 34.0, 30.0, 8.0
"""Height of a question, of the axis under all of them, and room beside the axis."""
LABEL, DOT = 13.0, 24.0
"""Where a question's label and its dot stand, from the top of its row."""
SIGN = 7.2
"""Estimated width of a sign of a label."""
WEAK = 0.2
"""A correlation below this is called weak (Source: R. L. Ebel, Essentials of Educational Measurement, 1979)."""
LEARNERS_MIN = 5
"""Learners who have to answer a question before it is called the hardest."""
BAR_WIDTH, BAR_HEIGHT = 120.0, 10.0

HEADINGS = ("Question", "Value", "95 % interval", "Learners")

Named = tuple[str, Estimate]


def plot_estimates(questions: Sequence[QuestionStatistics], titles: Mapping[str, str]) -> Iterator[Sketch]:
    """Says how hard the questions are, and what they tell apart; a plot without estimates is left out."""
    shares = [(titles[question.question], question.difficulty) for question in questions]
    if shares:
        title = describe_shares(shares)
        caption = (
            "Dots: the part of a question's points that learners have, late answers with what they keep; lines: "
            f"95{NARROW}% intervals (Wilson)."
        )
        yield plot_rows("difficulty", title, caption, shares, (0.0, 1.0))
    tells = [
        (titles[question.question], question.discrimination)
        for question in questions
        if question.discrimination is not None
    ]
    if tells:
        caption = (
            "Discrimination: correlation of the share at a question with that at the learner's other questions. "
            f"Near 0, it does not separate strong from weak; below, check its key. 95{NARROW}% intervals (Fisher)."
        )
        yield plot_rows("discrimination", describe_discrimination(tells), caption, tells, (-1.0, 1.0))


def describe_shares(shares: Sequence[Named]) -> str:
    """Names the hardest question, where its interval lies below those of all others."""
    (name, hardest), *others = sorted(shares, key=lambda share: share[1].value)
    if hardest.n < LEARNERS_MIN or not others:
        return "Share of the points"
    if any(estimate.low <= hardest.high for _, estimate in others):
        return "Share of the points: no question is clearly the hardest, as intervals overlap"
    return f"The hardest is “{name}”: {100 * hardest.value:.0f}{NARROW}% of its points"


def describe_discrimination(tells: Sequence[Named]) -> str:
    """Names a question that strong learners get wrong, else the one that separates least. An interval that contains 0
    and reaches beyond `WEAK` leaves both open."""
    name, least = min(tells, key=lambda pair: pair[1].value)
    if least.high < 0:
        return f"Strong learners do worse at “{name}” than weak ones: check its key"
    if least.low <= 0:
        if least.high < WEAK:
            return f"“{name}” does not separate strong from weak learners"
        return f"Too few answers to say whether “{name}” separates strong from weak learners"
    return "Every question separates strong from weak learners"


def plot_rows(name: str, title: str, caption: str, rows: Sequence[Named], ends: tuple[float, float]) -> Sketch:
    """Returns one plot: a row for each question."""
    table = tuple(
        (
            title,
            write_number(estimate.value, 2),
            f"{write_number(estimate.low, 2)} to {write_number(estimate.high, 2)}",
            str(estimate.n),
        )
        for title, estimate in rows
    )
    return Sketch(name, title, caption, (HEADINGS, *table), lambda width: draw(rows, ends, width))


def draw(rows: Sequence[Named], ends: tuple[float, float], width: float) -> Drawing:
    """Returns a dot with its interval for each question, under its title."""
    foot = ROW * len(rows)
    drawing, axis = Drawing(width, foot + FOOT), Axis(*ends, SIDE, width - SIDE)
    for tick in axis.ticks(5):
        drawing.line("reference" if tick == 0 > ends[0] else "grid", axis.at(tick), 0, axis.at(tick), foot)
    for place, (title, estimate) in enumerate(rows):
        top = place * ROW
        count = f"n = {estimate.n}"
        drawing.text(shorten(title, width - 2 * SIDE - SIGN * (len(count) + 2)), SIDE, top + LABEL, "told halo")
        drawing.text(count, width - SIDE, top + LABEL, "halo", anchor="end")
        drawing.line("line solid", axis.at(estimate.low), top + DOT, axis.at(estimate.high), top + DOT)
        drawing.dot("", axis.at(estimate.value), top + DOT)
    drawing.x_axis(axis, foot, "", 5)
    return drawing


def shorten(text: str, room: float) -> str:
    """As much of a text as fits, with an ellipsis where something is left out."""
    most = max(4, int(room / SIGN))
    return text if len(text) <= most else f"{text[: most - 1].rstrip()}…"


def draw_bar(count: float, of: float) -> Markup:
    """A bar as long as its part of the whole; the number stands beside it, so that it is no picture of its own."""
    length = BAR_WIDTH * count / max(of, 1)
    box = f'viewBox="0 0 {trim(BAR_WIDTH)} {trim(BAR_HEIGHT)}"'
    whole = f'<rect class="whole" width="{trim(BAR_WIDTH)}" height="{trim(BAR_HEIGHT)}"/>'
    part = f'<rect class="part" width="{trim(length)}" height="{trim(BAR_HEIGHT)}"/>'
    return Markup(f'<svg class="count-bar" {box} aria-hidden="true">{whole}{part}</svg>')  # noqa: S704  # numbers alone
