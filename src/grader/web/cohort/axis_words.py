"""What is said of a class on an axis: positions, limits and what is right there, in words."""

from grader.domain.axes import RIGHT, ClassAxis, Position
from grader.web.text.numbers import capitalize, keep_unbroken, write_number, write_quantity

TOLERANCE = "tolerance"
UNIT_SIGNS = 6
"""A longer unit stands in the heading, not at the ticks."""


def write_position(position: Position, axis: ClassAxis) -> str:
    """Returns a position in words."""
    if position.is_none:
        return axis.none
    if position.low == position.high:
        return write_value(position.low, axis)
    return f"{write_number(position.low)} to {write_value(position.high, axis)}"


def round_position(position: Position, figures: int, axis: ClassAxis) -> str:
    """Returns the middle of a position to some figures, so that equal methods give equal words."""
    if position.is_none:
        return f"“{axis.none}”"
    return write_value(float(f"{position.middle:.{figures}g}"), axis)


def write_value(value: float, axis: ClassAxis) -> str:
    """Returns a number on the axis, with its unit."""
    unit = axis.unit.removesuffix("s") if axis.is_whole and value == 1 else axis.unit
    return write_quantity(value, unit) if unit else write_number(value)


def name_line(axis: ClassAxis) -> str:
    """Returns the label of the line at the limit; empty where there is none."""
    value = axis.limit
    if value is None:
        return ""
    if axis.line:
        return axis.line if value == 1 or axis.is_whole else f"{axis.line} {write_value(value, axis)}"
    word = "limit" if axis.is_limit else "at most" if axis.is_at_most else "at least" if axis.is_at_least else "right"
    return f"{word} {write_value(value, axis)}"


def describe_right(axis: ClassAxis) -> str:
    """Says where the right value lies; nothing more where it is unknown."""
    value = axis.limit
    if value is None:
        return "here nothing is unstable" if axis.is_limit else "the right one is unknown"
    amount = write_value(value, axis)
    if axis.is_whole or axis.line == RIGHT:
        return f"{axis.line} are asked for" if axis.is_whole else "each learner has a right number of their own"
    if axis.line == TOLERANCE:
        return f"one {TOLERANCE} is allowed" if value == 1 else f"the {TOLERANCE} is {amount}"
    if axis.is_limit:
        return f"the limit is {amount}"
    if axis.is_at_most or axis.is_at_least:
        return f"at {'most' if axis.is_at_most else 'least'} {amount} is asked for"
    return f"{amount} is right"


def describe_near(axis: ClassAxis) -> str:
    """Says what those have in common who are right on this axis, after their number and that of all: `5 of 7 ...`."""
    if axis.is_limit:
        return "claims hold the limit"
    if axis.note:
        return "are right here"
    return "stay within the limit" if axis.is_at_most else "reach it" if axis.is_at_least else "numbers are right"


def describe_axis(axis: ClassAxis) -> str:
    """Returns the heading of the class on this axis."""
    title = capitalize(keep_unbroken(axis.title))
    if axis.is_limit:
        return f"{title}: where each learner says it lies"
    if axis.is_whole:
        return f"{title} by each learner"
    unit = f", in {axis.unit}" if len(axis.unit) > UNIT_SIGNS else ""
    return f"{title}: {axis.measure} of each learner{unit}" if axis.measure else f"{title} of each learner{unit}"
