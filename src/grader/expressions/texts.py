"""How numbers become text: `String(number)`, toFixed, toExponential and toPrecision. Source: ECMA-262."""

import math
from decimal import ROUND_HALF_UP, Context, Decimal

EXACT = Context(prec=1500)
"""Enough for every double: the smallest has 767 significant digits, the largest 309 before the point."""


def number_to_string(number: float) -> str:
    """`String(number)`: the shortest digits that read back as the same number."""
    if not math.isfinite(number):
        return "NaN" if math.isnan(number) else "Infinity" if number > 0 else "-Infinity"
    digits, exponent = _scientific(number, None)
    form = _decimal if -7 < exponent < 21 else _exponential
    return _sign(number) + form(digits, exponent)


def to_fixed(number: float, places: int) -> str:
    """`number.toFixed(places)`: the exact binary value, halves away from zero."""
    if not math.isfinite(number) or abs(number) >= 1e21:
        return number_to_string(number)
    rounded = Decimal(number).copy_abs().quantize(Decimal(1).scaleb(-places), rounding=ROUND_HALF_UP, context=EXACT)
    return f"{_sign(number)}{rounded:f}"


def to_exponential(number: float, places: int | None) -> str:
    """`number.toExponential(places)`; None for as many as needed."""
    if not math.isfinite(number):
        return number_to_string(number)
    return _sign(number) + _exponential(*_scientific(number, places))


def to_precision(number: float, count: int | None) -> str:
    """`number.toPrecision(count)`; None for as many digits as needed."""
    if count is None or not math.isfinite(number):
        return number_to_string(number)
    digits, exponent = _scientific(number, count - 1)
    form = _decimal if -7 < exponent < count else _exponential
    return _sign(number) + form(digits, exponent)


def _sign(number: float) -> str:
    return "-" if number < 0 else ""


def _scientific(number: float, places: int | None) -> tuple[str, int]:
    """All digits (one before the point and `places` after it, or as many as needed) and the exponent."""
    if not number:
        return "0" * ((places or 0) + 1), 0
    if places is None:
        exact = Decimal(repr(abs(number)))
        return "".join(map(str, exact.as_tuple().digits)).rstrip("0"), exact.adjusted()
    exact = Decimal(number).copy_abs()
    rounded = exact.quantize(Decimal(1).scaleb(exact.adjusted() - places), rounding=ROUND_HALF_UP, context=EXACT)
    return "".join(map(str, rounded.as_tuple().digits))[: places + 1], rounded.adjusted()


def _decimal(digits: str, exponent: int) -> str:
    if exponent < 0:
        return f"0.{'0' * (-exponent - 1)}{digits}"
    whole, fraction = digits[: exponent + 1], digits[exponent + 1 :]
    return whole.ljust(exponent + 1, "0") + ("." + fraction if fraction else "")


def _exponential(digits: str, exponent: int) -> str:
    fraction = "." + digits[1:] if len(digits) > 1 else ""
    return f"{digits[0]}{fraction}e{'+' if exponent >= 0 else '-'}{abs(exponent)}"
