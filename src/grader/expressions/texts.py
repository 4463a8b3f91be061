"""How numbers become text: `String(number)`, toFixed, toExponential and toPrecision. Source: ECMA-262."""

import math
from decimal import ROUND_HALF_UP, Context, Decimal

EXACT = Context(prec=1500, rounding=ROUND_HALF_UP)
"""Enough for every double: the smallest has 767 significant digits, the largest 309 before the point."""


def number_to_string(number: float) -> str:
    """`String(number)`: the shortest digits that read back as the same number."""
    if not math.isfinite(number):
        return "NaN" if math.isnan(number) else "Infinity" if number > 0 else "-Infinity"
    shortest = _round(number, None)
    return f"{shortest:f}" if -7 < shortest.adjusted() < 21 else f"{shortest:e}"


def to_fixed(number: float, places: int) -> str:
    """`number.toFixed(places)`: the exact binary value, halves away from zero."""
    if not math.isfinite(number) or abs(number) >= 1e21:
        return number_to_string(number)
    return f"{EXACT.quantize(Decimal(number or 0.0), Decimal(1).scaleb(-places)):f}"


def to_exponential(number: float, places: int | None) -> str:
    """`number.toExponential(places)`; None for as many as needed."""
    if not math.isfinite(number):
        return number_to_string(number)
    if places is None:
        return f"{_round(number, None):e}"
    zero = Decimal(0).scaleb(-places)  # a Decimal keeps the places of a zero in its exponent
    return f"{_round(number, places + 1) or zero:.{places}e}"


def to_precision(number: float, count: int | None) -> str:
    """`number.toPrecision(count)`; None for as many digits as needed."""
    if count is None or not math.isfinite(number):
        return number_to_string(number)
    rounded = _round(number, count)
    exponent = rounded.adjusted()
    return f"{rounded:.{count - 1 - exponent}f}" if -7 < exponent < count else f"{rounded:.{count - 1}e}"


def _round(number: float, digits: int | None) -> Decimal:
    """The number with so many significant digits, halves away from zero; None for the shortest that reads back."""
    if digits is None:
        return EXACT.normalize(Decimal(repr(number or 0.0)))
    return Context(prec=digits, rounding=ROUND_HALF_UP).create_decimal(number or 0.0)
