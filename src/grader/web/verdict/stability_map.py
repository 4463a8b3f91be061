"""The stability map: each integrator's stable and growing timesteps, its limit, and the learner's claim upon it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from grader.web.text.numbers import write_number, write_quantity
from grader.web.verdict.evidence import Claim, Limit, Run
from grader.web.verdict.svg import Axis, Drawing, Sketch, estimate_width

ROW, BAR, MAGNIFIED = 66.0, 18.0, 40.0
TOP, FOOT = 28.0, 40.0
NARROW = 480.0
"""Below this width labels are shorter."""

MAGNIFIED_MS = 0.7
"""Half the width of a magnified row."""

SLIVER_PX = 4.0
"""The claim is drawn at least this wide."""

BAND_PX = 16.0
"""A claim of this width is drawn as a band between two edges, through which the zones are seen."""

CLOSE = 0.02
"""Where a claim lies this near to the spring's limit, relative to it, the title says so."""


@dataclass(frozen=True)
class MapRow:
    """One integrator: what is known of its zones [ms]. Without the limit, the learner's own two runs tell a part."""

    claim: Claim
    limit: Limit | None
    stable_to: float | None
    grows_from: float | None
    ends: tuple[bool | None, bool | None]

    @property
    def is_right(self) -> bool | None:
        """Whether the runs at the ends bear out the claim; None where there was nothing to run."""
        low, high = self.ends
        return None if low is None or high is None else (not low and high)


def plot_stability(claims: Sequence[Claim], limits: Mapping[str, Limit], runs: Sequence[Run], case: str) -> Sketch:
    """Plots the map of one case."""
    rows = [make_row(claim, limits.get(claim.case), runs) for claim in claims]
    spring = next((row.limit.spring_ms for row in rows if row.limit), None)
    known = any(row.limit for row in rows)
    zones = "tinted is stable for ever, hatched grows" if known else "what the runs at the ends of your brackets show"
    caption = f"{f'{case}: {zones}' if case else zones.capitalize()}. The bold bar is your claim."
    if known:
        horizon = write_quantity(claims[0].horizon_s, "s")
        caption += (
            f" A run of {horizon} may still look stable a little above its limit, and a bracket there is right as well."
        )
    name = f"map-{claims[0].case.rpartition('.')[0] or 'all'}"
    return Sketch(name, choose_title(rows, spring), caption, make_table(rows), lambda width: draw(rows, spring, width))


def is_near(row: MapRow) -> bool:
    """Says whether claim and limit lie too near to each other to be told apart on the whole axis."""
    claim, limit = row.claim.claim_ms, row.limit
    if claim is None or limit is None or limit.linear_ms is None:
        return False
    return max(abs(end - limit.linear_ms) for end in claim) < MAGNIFIED_MS


def make_row(claim: Claim, limit: Limit | None, runs: Sequence[Run]) -> MapRow:
    """Says what is known under one integrator."""
    low, high = claim.search_ms
    ended = {run.end: run for run in runs if run.case == claim.case}
    diverged = tuple(ended[end].diverged if end in ended else None for end in ("lower end", "upper end"))
    ends = (diverged[0], diverged[1])
    if limit is not None:
        return MapRow(claim, limit, limit.linear_ms or high, limit.linear_ms, ends)
    stable = [run.timestep_ms for run in ended.values() if not run.diverged]
    grows = [run.timestep_ms for run in ended.values() if run.diverged]
    stable_to, grows_from = max(stable, default=None), min(grows, default=None)
    if stable_to is not None and grows_from is not None and stable_to > grows_from:
        stable_to = None  # a second stable zone: nothing is known below it
    return MapRow(claim, None, stable_to if stable_to is None or stable_to > low else None, grows_from, ends)


def choose_title(rows: Sequence[MapRow], spring: float | None) -> str:
    """Says what is to be seen."""
    wrong = [row for row in rows if row.limit and judge_claim(row) not in ("right", None)]
    if not any(row.limit for row in rows):
        bad = [row.claim.integrator for row in rows if row.is_right is False]
        named = " and ".join([", ".join(bad[:-1]), *bad[-1:]] if len(bad) > 1 else bad)
        return f"Look at {named}: an end of your bracket is on the wrong side" if bad else "Your brackets"
    if not wrong:
        return "Each of your brackets agrees with its limit"
    middles = [sum(row.claim.claim_ms) / 2 for row in wrong if row.claim.claim_ms]
    if spring and middles and all(abs(middle - spring) < CLOSE * spring for middle in middles):
        return "Your limit is the spring's alone: the damper is missing"
    if len(middles) > 1 and max(middles) - min(middles) < CLOSE * max(middles):
        return "You found the same limit for integrators that have different ones"
    first = wrong[0]
    return f"Your claim under {first.claim.integrator} is {judge_claim(first)}"


def judge_claim(row: MapRow) -> str | None:
    """Says where a claim lies, in words; None where there is neither a claim nor a limit to compare."""
    claim, limit = row.claim.claim_ms, row.limit
    if limit is None or (claim is None and not row.claim.said_none):
        return None
    if limit.linear_ms is None or limit.within_ms is None:
        return "right" if claim is None else "not there: it has no limit"
    if claim is None:
        return "missing: it has a limit"
    if claim[0] > limit.within_ms * 1.003:
        return "too high"
    return "too low" if claim[1] < limit.linear_ms * 0.997 else "right"


def describe_claim(row: MapRow) -> str:
    """Returns the claim in words."""
    claim = row.claim.claim_ms
    if claim is None:
        return "None" if row.claim.said_none else "nothing readable"
    return f"{write_number(claim[0])} to {write_quantity(claim[1], 'ms')}"


def describe_limit(row: MapRow) -> str:
    """Returns the limit in words."""
    if row.limit is None:
        return ""
    if row.limit.linear_ms is None:
        return f"no limit up to {write_quantity(row.claim.search_ms[1], 'ms')}"
    return write_quantity(row.limit.linear_ms, "ms")


def make_table(rows: Sequence[MapRow]) -> tuple[tuple[str, ...], ...]:
    """Returns the map as a table, for those who do not see it."""
    words = {None: "not run", True: "unstable", False: "stable"}
    known = any(row.limit for row in rows)
    head = ("Integrator", "Your claim", "Run at the lower end", "Run at the upper end")
    body = [(row.claim.integrator, describe_claim(row), words[row.ends[0]], words[row.ends[1]]) for row in rows]
    if not known:
        return (head, *body)
    horizon = write_quantity(rows[0].claim.horizon_s, "s")
    more = [(describe_limit(row), describe_limit_within(row)) for row in rows]
    whole = ((*one, *two) for one, two in zip(body, more, strict=True))
    return ((*head, "Linear stability limit", f"Limit within {horizon}"), *whole)


def describe_limit_within(row: MapRow) -> str:
    """Words the limit within the horizon."""
    if row.limit is None:
        return ""
    return "none" if row.limit.within_ms is None else write_quantity(row.limit.within_ms, "ms")


def draw(rows: Sequence[MapRow], spring: float | None, width: float) -> Drawing:
    """Returns the map at a width."""
    magnified = [row for row in rows if is_near(row)]
    height = TOP + ROW * len(rows) + FOOT + (MAGNIFIED + ROW) * len(magnified)
    picture = Drawing(width, height)
    low, high = rows[0].claim.search_ms
    axis = Axis(low, high, 1, width - 1)
    bottom = TOP + ROW * len(rows) - 6
    if spring is not None and low < spring < high:
        x = axis.at(spring)
        limit = write_quantity(spring, "ms")
        words = f"spring alone: {limit}" if width < NARROW else f"2/ω = {limit}: the spring alone"
        picture.line("reference", x, TOP - 8, x, bottom)
        picture.text(words, x, TOP - 14, anchor="middle")
    for index, row in enumerate(rows):
        draw_row(picture, row, axis, TOP + ROW * index, bound=spring)
    picture.x_axis(axis, bottom, "ms", about=5)
    for index, row in enumerate(magnified):
        draw_magnified(picture, row, bottom + FOOT + (MAGNIFIED + ROW) * index)
    return picture


def draw_magnified(picture: Drawing, row: MapRow, top: float) -> None:
    """The surroundings of a limit on an axis of their own."""
    assert row.limit is not None and row.limit.linear_ms is not None
    low, high = row.limit.linear_ms - MAGNIFIED_MS, row.limit.linear_ms + MAGNIFIED_MS
    claim = row.claim.model_copy(update={"search_ms": (low, high)})
    near_by = Axis(low, high, 1, picture.width - 1)
    draw_row(
        picture, replace(row, claim=claim), near_by, top + MAGNIFIED - 14, name=f"{row.claim.integrator}, magnified"
    )
    picture.x_axis(near_by, top + MAGNIFIED + BAR + 26, "ms", about=5)


def draw_row(
    picture: Drawing, row: MapRow, axis: Axis, top: float, *, name: str = "", bound: float | None = None
) -> None:  # fmt: skip
    """One integrator's bar with its limit and the claim; `bound` is where a line crosses all bars."""
    low, high = row.claim.search_ms
    kind, y = row.claim.integrator, top + 14
    picture.text(name or kind, axis.start, y - (20 if name else 4), "name halo")
    if row.limit is None:
        picture.box("axis", axis.start, y, axis.end - axis.start, BAR)
    if row.stable_to is not None:
        end = axis.at(min(row.stable_to, high))
        picture.box(f"stable {kind}", axis.start, y, end - axis.start, BAR)
        picture.box(f"base {kind}", axis.start, y + BAR - 2, end - axis.start, 2)
        if end - axis.start > 60:
            picture.text("stable", axis.start + 6, y + 13, "told")
    if row.grows_from is not None and row.grows_from < high:
        start = axis.at(max(row.grows_from, low))
        picture.hatch(f"grows {kind}", start, y, axis.end - start, BAR)
        if axis.end - start > 60:
            picture.text("grows", axis.end - 6, y + 13, "told halo", "end")
    if row.limit is not None and name:
        draw_span(picture, row, axis, y)
    elif row.limit is not None:
        draw_limit(picture, row, axis, y, bound)
    draw_claim(picture, row, axis, y)


def draw_limit(picture: Drawing, row: MapRow, axis: Axis, y: float, bound: float | None) -> None:
    """The labelled tick where stability ends; its label keeps clear of the line at `bound` where there is room."""
    words = describe_limit(row)
    if row.limit is None or row.limit.linear_ms is None:
        picture.text(words, axis.end, y - 4, anchor="end")
        return
    x = axis.at(row.limit.linear_ms)
    picture.line("limit", x, y - 4, x, y + BAR)
    label = f"limit {words}"
    is_left = x > axis.start + 0.62 * (axis.end - axis.start)
    if bound is not None and x < axis.at(bound) < x + estimate_width(label) + 8:
        room = x - axis.start - estimate_width(row.claim.integrator) - 12
        label = label if estimate_width(label) < room else words
        is_left = estimate_width(label) < room
    picture.text(label, x - 4 if is_left else x + 4, y - 4, "label halo", "end" if is_left else "start")


def draw_span(picture: Drawing, row: MapRow, axis: Axis, y: float) -> None:
    """Both limits, for ever and within the horizon: a bracket that meets the span between them is right."""
    assert row.limit is not None
    late = f"within {write_quantity(row.claim.horizon_s, 's')} {write_quantity(row.limit.within_ms, 'ms')}"
    for value, words, anchor in (
        (row.limit.linear_ms, describe_limit(row), "end"),
        (row.limit.within_ms, late, "start"),
    ):
        if value is not None and value < row.claim.search_ms[1]:
            x = axis.at(value)
            picture.line("limit", x, y - 4, x, y + BAR)
            picture.text(words, x + (-4 if anchor == "end" else 4), y - 4, "told halo", anchor)


def draw_claim(picture: Drawing, row: MapRow, axis: Axis, y: float) -> None:
    """The claim: a black band where there is a bracket within the axis, and its words."""
    claim = row.claim.claim_ms
    words = f"you: {describe_claim(row)}"
    below = y + BAR + 15
    if claim is None:
        picture.text(words, axis.end, below, "name", "end")
        return
    low, high = row.claim.search_ms
    if claim[1] < low or claim[0] > high:
        x, anchor = (axis.start, "start") if claim[1] < low else (axis.end, "end")
        picture.text(f"{words}, off the axis", x, below, "name", anchor)
        return
    left, right = axis.at(max(claim[0], low)), axis.at(min(claim[1], high))
    wide = max(right - left, SLIVER_PX)
    middle = (left + right) / 2
    if wide < BAND_PX:
        picture.box("claim", middle - wide / 2, y - 3, wide, BAR + 6)
    else:
        picture.box("claim-band", left, y - 3, wide, BAR + 6)
        for edge in (left, right):
            picture.box("claim", edge - 1.5, y - 3, 3, BAR + 6)
    picture.text(words, middle, below, "name halo", "middle")
