"""Draws a certificate: the key with its tolerance as a band, and what the simulation measured beside it."""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from grader.web.text.numbers import write_number, write_quantity
from grader.web.verdict.line_plots import HEIGHT, LEFT, RIGHT, TOP, make_frame
from grader.web.verdict.plots import Figure, draw_both
from grader.web.verdict.svg import Axis, Drawing, Sketch

DIGITS = 6
"""Significant figures of what was measured."""

WIDTH = 420.0
"""Of the wide picture: it stands in a column."""

STRIP, BAR = 96.0, 26.0
"""Height of the strip of timesteps, and of the bar on it."""

ROOM = 0.35
"""Room on each side of what is drawn, as a share of its extent."""


def draw_key(certificate: Mapping[str, Any]) -> Figure | None:
    """Returns the picture of a certificate, as `Certificate.to_json` writes it: of a limit its bracket, of a measured
    number its values at ever shorter timesteps. None where there is nothing to draw."""
    measured, tolerance = certificate["measured"], certificate["tolerance"]
    if tolerance is None or not isfinite(tolerance):
        return None
    key, unit = float(certificate["expected"]), str(measured.get("unit") or "")
    if "stable at" in measured and "unstable at" in measured:
        return draw_both(plot_bracket(key, tolerance, measured["stable at"], measured["unstable at"], unit), WIDTH)
    values = {float(name[2:]): value for name, value in measured.items() if name.startswith("h/")}
    if len(values) < 2:
        return None
    return draw_both(plot_refinement(key, tolerance, values, measured.get("nudged", ()), unit), WIDTH)


def plot_bracket(key: float, tolerance: float, stable: float, unstable: float, unit: str) -> Sketch:
    """The timesteps about a limit: what stays stable, what does not, and the band of the key."""
    inside = key - tolerance <= stable and unstable <= key + tolerance
    title = f"The limit lies {'within' if inside else 'outside'} the key's tolerance"
    caption = f"Stable at {write_quantity(stable, unit, DIGITS)}, unstable at {write_quantity(unstable, unit, DIGITS)}."
    table = (
        ("", "From", "To"),
        ("Key", write_number(key - tolerance, DIGITS), write_number(key + tolerance, DIGITS)),
        ("Limit", write_number(stable, DIGITS), write_number(unstable, DIGITS)),
    )

    def draw(width: float) -> Drawing:
        low, high = widen(key - tolerance, key + tolerance, stable, unstable)
        across, picture, foot = Axis(low, high, RIGHT, width - RIGHT), Drawing(width, STRIP + 44), STRIP
        left, right = across.at(stable), across.at(unstable)
        picture.box("passes", across.at(key - tolerance), TOP, across.at(key + tolerance) - across.at(key - tolerance),
                    foot - TOP)  # fmt: skip
        picture.text(f"the key: {write_quantity(key, unit)}", across.at(key), TOP - 8, "name", "middle")
        picture.box("shade", RIGHT, foot - BAR, left - RIGHT, BAR)
        picture.hatch("grid", right, foot - BAR, width - RIGHT - right, BAR)
        picture.line("limit", (left + right) / 2, foot - BAR - 6, (left + right) / 2, foot)
        picture.text("stable", RIGHT + 6, foot - 8, "halo")
        picture.text("unstable", width - RIGHT - 6, foot - 8, "halo", "end")
        picture.x_axis(across, foot, unit, 5)
        return picture

    return Sketch("key", title, caption, table, draw)


def plot_refinement(
    key: float, tolerance: float, values: Mapping[float, float], nudged: Sequence[float], unit: str
) -> Sketch:
    """A measured number at the model's timestep and at shorter ones, from left to right, over the band of the key."""
    finest = values[max(values)]
    inside = abs(finest - key) <= tolerance
    title = f"What is measured lies {'within' if inside else 'outside'} the key's tolerance"
    caption = "The number at the model's timestep h and at shorter ones; dots at h stand for starts that are shifted."
    rows = [(name_timestep(finer), write_number(values[finer], DIGITS)) for finer in sorted(values)]
    rows += [("h, shifted", write_number(value, DIGITS)) for value in nudged]
    table = (("Timestep", f"Measured [{unit}]" if unit else "Measured"), *rows)

    def draw(width: float) -> Drawing:
        ends = widen(key - tolerance, key + tolerance, *values.values(), *nudged)
        picture, across, up = make_frame(width, (0.85, 1.2 * max(values)), ends, (True, False))
        foot, top, bottom = up.start, up.at(key + tolerance), up.at(key - tolerance)
        picture.box("passes", LEFT, top, width - RIGHT - LEFT, bottom - top)
        picture.y_axis(up, LEFT, width - RIGHT, 4)
        picture.line("axis", LEFT, foot, width - RIGHT, foot)
        picture.text(unit, 0, 12)
        named = f"the key: {write_number(key, DIGITS)} ± {write_number(tolerance, 2)}"
        picture.text(named, width - RIGHT - 4, top + 16, "halo", "end")
        points = [(across.at(finer), up.at(values[finer])) for finer in sorted(values)]
        picture.path("line solid", points)
        for x, y in points:
            picture.dot("", x, y)
        for value in nudged:
            picture.dot("", across.at(1.0), up.at(value))
        for finer in sorted(values):
            if finer == round(finer):
                picture.text(name_timestep(finer), across.at(finer), foot + 18, anchor="middle")
        picture.text("timestep", (LEFT + width) / 2, HEIGHT - 6, anchor="middle")
        return picture

    return Sketch("key", title, caption, table, draw)


def name_timestep(finer: float) -> str:
    """Returns the name of a timestep that is so many times shorter than the model's."""
    return "h" if finer == 1 else f"h/{write_number(finer, 4)}"


def widen(*values: float) -> tuple[float, float]:
    """Returns the ends of an axis on which all values lie, with room on both sides."""
    low, high = min(values), max(values)
    room = ROOM * (high - low) or 1.0
    return low - room, high + room
