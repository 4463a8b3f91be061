"""Compares the unit of a claim with what is measured: a period is measured in seconds, and is no number of
milliseconds until `scale` makes it one."""

from contextlib import suppress
from math import isclose, tau

import mujoco

from grader.domain.quantities import BASE_UNITS
from grader.errors import InvalidAnswer
from grader.exercises.kinds.claims.parameters import Claim
from grader.questions.kinds.number.dimensions import explain_unit
from grader.questions.kinds.number.units import convert, known_unit, read_unit


def explain_unit_of_claim(claim: Claim, model: mujoco.MjModel) -> str | None:
    """Returns why what is measured is not in the unit of a claim; None where it is, or is not known. A `scale` may do
    more than convert, so that with one only what the unit measures is compared."""
    if known_unit(claim.unit) is None:
        return None
    if base := BASE_UNITS.get(claim.quantity):
        return explain_moments(claim, base)
    expr = claim.expr if claim.scale == 1 else f"{claim.scale!r} * ({claim.expr})"
    why = explain_unit(expr, model, claim.unit)
    return why and f"{why}, or give `scale`"


def explain_moments(claim: Claim, base: str) -> str | None:
    """Returns why a quantity that is read from moments is not in the unit of its claim."""
    measured = [(1.0, base)]
    if claim.quantity == "frequency":
        measured.append((tau, "rad/s"))
    factors = list[float]()
    for size, name in measured:
        with suppress(InvalidAnswer):
            factors.append(convert(size, read_unit(name), read_unit(claim.unit)))
    what = f"the {claim.quantity.replace('_', ' ')} is measured in {base}"
    if not factors:
        return f"{what}, and {claim.unit} measures something else: write another unit"
    if claim.scale != 1 or any(isclose(factor, 1) for factor in factors):
        return None
    return f"{what}, and the unit is {claim.unit}: give `scale` {factors[0]:.9g}, or the unit {base}"
