"""Writes an expression in the unit of a question, where it is known what the expression measures."""

from dataclasses import dataclass
from functools import partial
from math import isclose, log10, pi, tau

import mujoco

from grader.certify.proposals.scenes import ShownExpression
from grader.errors import InvalidAnswer
from grader.questions.kinds.number.dimensions import find_unit_dimension, read_dimension
from grader.questions.kinds.number.units import convert, known_unit


@dataclass(frozen=True)
class FittedExpression:
    """An expression in the unit of a question. `is_certain` says that its dimension was read and is that of the unit,
    `factor` what the shown expression is multiplied by; None where it is in another unit."""

    expr: str
    shown: ShownExpression
    factor: float | None
    is_certain: bool


def fit_unit(shown: ShownExpression, model: mujoco.MjModel, unit: str | None) -> FittedExpression | None:
    """Returns an expression in a unit; None where it measures something else."""
    wanted, measured = find_unit_dimension(unit or ""), read_dimension(shown.expr, model)
    if not unit or known_unit(unit) is None:
        return FittedExpression(shown.expr, shown, 1.0, is_certain=False)
    if measured is None:
        return fit_declared(shown, unit)
    if wanted is None or not all(map(partial(isclose, abs_tol=1e-9), measured.powers, wanted.powers)):
        return None
    if measured.size is None or (measured.may_count and wanted.size is None):  # it may do so already
        return fit_declared(shown, unit)
    factor = find_factor(measured.name, unit)
    if factor is None and wanted.size is not None:
        factor = measured.size / wanted.size
    if factor is None:  # turns are counted, and measured are radians
        cycles = find_factor("Hz", unit)
        if cycles is None:
            return None
        factor = measured.size * cycles / tau
    return FittedExpression(multiply(shown.expr, factor), shown, factor, is_certain=True)


def fit_declared(shown: ShownExpression, unit: str) -> FittedExpression | None:
    """Returns an expression whose dimension cannot be read, by the unit that its label declares."""
    if not shown.unit or known_unit(shown.unit) is None:
        return FittedExpression(shown.expr, shown, 1.0, is_certain=False)
    factor = find_factor(shown.unit, unit)
    return None if factor is None else FittedExpression(multiply(shown.expr, factor), shown, factor, is_certain=True)


def find_factor(given: str, wanted: str) -> float | None:
    """Returns what a number in one unit is multiplied by to be in another, or None where that is not known."""
    one, other = known_unit(given), known_unit(wanted)
    if one is None or other is None:
        return None
    try:
        return convert(1.0, one, other)
    except InvalidAnswer:
        return None


def multiply(expr: str, factor: float) -> str:
    """Returns an expression times a factor, written so that its dimension can still be read."""
    if isclose(factor, 1.0):
        return expr
    inner = expr if expr.replace("_", "").replace(".", "").replace("[", "").replace("]", "").isalnum() else f"({expr})"
    if isclose(factor, 180 / pi):
        return f"{inner} * 180 / Math.PI"
    if isclose(factor, pi / 180):
        return f"{inner} * Math.PI / 180"
    power = log10(factor) if factor > 0 else 0.5
    if isclose(power, round(power), abs_tol=1e-12):
        return f"{10 ** round(power)} * {inner}" if power > 0 else f"{inner} / {10 ** -round(power)}"
    return f"{factor:.12g} * {inner}"
