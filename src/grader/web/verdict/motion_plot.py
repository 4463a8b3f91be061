"""The motion at both ends of each claimed bracket: capped axes, and a cross where a run ends."""

from collections.abc import Mapping, Sequence
from itertools import groupby

from grader.web.text.numbers import write_quantity
from grader.web.verdict.evidence import Run
from grader.web.verdict.svg import Axis, Drawing, Sketch

PANEL, GAP = 118.0, 30.0
LEFT, TITLE, BELOW = 34.0, 46.0, 30.0
NARROW = 480.0
ROWS_MAX = 6
"""Integrators that are drawn; the table has all."""

GROWTH = 1.05
"""A motion whose last third reaches this much further than its first grows."""

SETTLED = 0.02
"""A motion has settled when it stays below this part of its largest value."""

NEARLY = 0.9
"""A motion that settles later than this part of the run has not settled."""


def plot_motion(runs: Sequence[Run], integrators: Mapping[str, str]) -> Sketch:
    """Plots the runs of all visible cases."""
    rows = [list(some) for _, some in groupby(runs, key=lambda run: run.case)]
    table = tuple(
        (integrators.get(run.case, run.case), run.end, write_quantity(run.timestep_ms, "ms"), describe_run(run))
        for run in runs
    )
    caption = (
        "The first coordinate (rad or m) in our own runs. Where a run diverges, the axis stops at twice the start."
    )
    head = ("Integrator", "End of your bracket", "Timestep", "What the run does")
    title = "What the judge's runs did at both ends of your bracket"
    return Sketch("motion", title, caption, (head, *table), lambda width: draw(rows[:ROWS_MAX], integrators, width))


def describe_run(run: Run) -> str:
    """Says what becomes of a run, in words."""
    if run.diverged:
        return f"warning at {write_quantity(run.time_s[-1], 's', 3)}"
    reach = [abs(value) for value in run.angle]
    third = max(1, len(reach) // 3)
    first, last = max(reach[:third]), max(reach[-third:])
    if last > GROWTH * first:
        return f"grows; no warning within {write_quantity(run.time_s[-1], 's', 2)}"
    if last >= first / 2:
        return "keeps its size"
    settled = find_settling_time(run)
    if settled > NEARLY * run.time_s[-1]:
        return f"decays; not at rest after {write_quantity(run.time_s[-1], 's', 2)}"
    return f"settles by {write_quantity(settled, 's', 2)}"


def find_settling_time(run: Run) -> float:
    """When the motion has come down to a small part of its start for good [s]; the end of the run if it has not."""
    small = SETTLED * max(abs(value) for value in run.angle)
    late = [time for time, value in zip(run.time_s, run.angle, strict=False) if abs(value) > small]
    return min(max(late, default=0.0), run.time_s[-1])


def draw(rows: Sequence[Sequence[Run]], integrators: Mapping[str, str], width: float) -> Drawing:
    """Two panels a row, or one below the other on a narrow page."""
    is_narrow = width < NARROW
    across = 1 if is_narrow else 2
    panel_width = (width - GAP * (across - 1)) / across
    lines = [row[start : start + across] for row in rows for start in range(0, len(row), across)]
    picture = Drawing(width, len(lines) * (TITLE + PANEL + BELOW))
    for line_number, line in enumerate(lines):
        top = line_number * (TITLE + PANEL + BELOW)
        for column, run in enumerate(line):
            draw_panel(picture, run, integrators.get(run.case, ""), (column * (panel_width + GAP), top, panel_width))
    return picture


def draw_panel(picture: Drawing, run: Run, integrator: str, place: tuple[float, float, float]) -> None:
    """One run."""
    x, top, width = place
    reach = [abs(value) for value in run.angle]
    cap = max(2 * reach[0] if run.diverged else 1.1 * max(reach), 1e-9)
    seconds = max(run.time_s[-1], 1e-9)
    shown = 1.2 * seconds if run.diverged else min(seconds, 1.5 * find_settling_time(run)) or seconds
    frame_top, bottom = top + TITLE, top + TITLE + PANEL
    across, up = Axis(0, shown, x + LEFT, x + width - 8), Axis(-cap, cap, bottom, frame_top)
    picture.text(f"{integrator}, {run.end}, {write_quantity(run.timestep_ms, 'ms')}".lstrip(", "), x, top + 14, "name")
    picture.y_axis(up, across.start, across.end, 3)
    if run.diverged:
        picture.box("shade", across.at(seconds), frame_top, across.end - across.at(seconds), PANEL)
    inner = Drawing(picture.width, picture.height)
    inner.path(
        f"line solid {integrator}", [(across.at(t), up.at(q)) for t, q in zip(run.time_s, run.angle, strict=False)]
    )
    picture.clipped(across.start, frame_top, across.end - across.start, PANEL, inner)
    if run.diverged:
        picture.cross(across.at(seconds), frame_top + 2)
    picture.text(describe_run(run), x, top + 31, "fault" if run.diverged else "told")
    picture.x_axis(across, bottom, "s", 4)
