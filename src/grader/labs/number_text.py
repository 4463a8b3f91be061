"""Numbers as text: toFixed, toPrecision and toExponential, exact to the last digit."""

import math
from decimal import ROUND_HALF_UP, Context, Decimal

from grader.labs.machine import Machine
from grader.labs.values import UNDEFINED, Trouble, Value, number_to_string, to_index, to_number

EXACT = Context(prec=1500)
"""Enough for every double: the smallest has 767 significant digits, the largest 309 before the point."""


def _digits(value: Value, low: int, high: int) -> int:
    digits = to_index(value)
    if not low <= digits <= high:
        raise Trouble(f"the number of digits must be from {low} to {high}")
    return digits


def to_fixed(number: float, digits: int) -> str:
    """`number.toFixed(digits)`: the exact binary value, halves away from zero. Source: ECMA-262."""
    if not math.isfinite(number) or abs(number) >= 1e21:
        return number_to_string(number)
    rounded = Decimal(number).copy_abs().quantize(Decimal(1).scaleb(-digits), rounding=ROUND_HALF_UP, context=EXACT)
    return f"{'-' if number < 0 else ''}{rounded:f}"


def _to_fixed(m: Machine, this: Value, digits: Value = UNDEFINED) -> Value:
    return to_fixed(to_number(this), _digits(digits, 0, 100))


def _scientific(number: float, places: int | None) -> tuple[str, int]:
    """All digits (one before the point and `places` after it, or as many as needed) and the exponent."""
    if places is None:
        exact = Decimal(repr(abs(number)))
        text = "".join(map(str, exact.as_tuple().digits)).rstrip("0") or "0"
        return text, exact.adjusted() if number else 0
    exact = Decimal(number).copy_abs()
    if not number:
        return "0" * (places + 1), 0
    rounded = exact.quantize(Decimal(1).scaleb(exact.adjusted() - places), rounding=ROUND_HALF_UP, context=EXACT)
    return "".join(map(str, rounded.as_tuple().digits))[: places + 1], rounded.adjusted()


def _exponential(sign: str, digits: str, exponent: int) -> str:
    tail = "." + digits[1:] if len(digits) > 1 else ""
    return f"{sign}{digits[0]}{tail}e{'+' if exponent >= 0 else '-'}{abs(exponent)}"


def _to_exponential(m: Machine, this: Value, places: Value = UNDEFINED) -> Value:
    number = to_number(this)
    if not math.isfinite(number):
        return number_to_string(number)
    wanted = None if places is UNDEFINED else _digits(places, 0, 100)
    return _exponential("-" if number < 0 else "", *_scientific(number, wanted))


def _to_precision(m: Machine, this: Value, precision: Value = UNDEFINED) -> Value:
    number = to_number(this)
    if precision is UNDEFINED or not math.isfinite(number):
        return number_to_string(number)
    count = _digits(precision, 1, 100)
    digits, exponent = _scientific(number, count - 1)
    sign = "-" if number < 0 else ""
    if exponent < -6 or exponent >= count:
        return _exponential(sign, digits, exponent)
    if exponent >= 0:
        return sign + digits[: exponent + 1] + ("." + digits[exponent + 1 :] if exponent + 1 < count else "")
    return f"{sign}0.{'0' * (-exponent - 1)}{digits}"


METHODS = {"toFixed": _to_fixed, "toExponential": _to_exponential, "toPrecision": _to_precision}
