"""The constants, and the functions of `Math`. `Math.random` is left out: a lab gives the same run every time."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from grader.expressions.fields import split_names
from grader.expressions.values import power

Numeric = Callable[..., float]
"""A function of floats."""

CONSTANTS = {
    "NaN": math.nan, "Infinity": math.inf, "Math.PI": math.pi, "Math.E": math.e, "Math.LN2": math.log(2),
    "Math.LN10": math.log(10), "Math.LOG2E": 1.4426950408889634, "Math.LOG10E": 0.4342944819032518,
    "Math.SQRT2": math.sqrt(2), "Math.SQRT1_2": math.sqrt(0.5), "Number.EPSILON": 2.0**-52,
    "Number.MAX_SAFE_INTEGER": 2.0**53 - 1, "Number.MIN_SAFE_INTEGER": 1 - 2.0**53,
    "Number.MAX_VALUE": 1.7976931348623157e308, "Number.MIN_VALUE": 5e-324, "Number.POSITIVE_INFINITY": math.inf,
    "Number.NEGATIVE_INFINITY": -math.inf, "Number.NaN": math.nan,
}  # fmt: skip


def _make_total(function: Callable[[float], float], poles: Mapping[float, float] = MappingProxyType({})) -> Numeric:
    """The function with its values at `poles`, NaN elsewhere outside its domain, and infinities for what overflows."""

    def call(x: float) -> float:
        try:
            return function(x)
        except ValueError:
            return poles.get(x, math.nan)
        except OverflowError:
            return math.copysign(math.inf, x)

    return call


def _make_rounding(function: Callable[[float], int]) -> Numeric:
    """Rounding that keeps the sign of zero, infinities and NaN."""
    return lambda x: math.copysign(float(function(x)), x) if math.isfinite(x) else x


def _round_half_up(x: float) -> int:
    below = math.floor(x)
    return below + 1 if x - below >= 0.5 else below


def _fround(x: float) -> float:
    with np.errstate(over="ignore"):
        return float(np.float32(x))


def find_largest(*numbers: float) -> float:
    """`Math.max`: NaN if any is NaN; 0 is larger than -0."""
    best = -math.inf
    for x in numbers:
        if x > best or (x == best == 0 and math.copysign(1.0, x) > 0):
            best = x
        elif math.isnan(x):
            return x
    return best


def find_smallest(*numbers: float) -> float:
    """`Math.min`: NaN if any is NaN; -0 is smaller than 0."""
    return -find_largest(*[-x for x in numbers])


FUNCTIONS: dict[str, Numeric] = {
    **{
        name: _make_total(getattr(math, name))
        for name in split_names("sqrt exp expm1 sin cos tan asin acos sinh acosh")
    },
    **{name: _make_total(getattr(math, name), {0.0: -math.inf}) for name in split_names("log log2 log10")},
    **{name: _make_rounding(getattr(math, name)) for name in split_names("floor ceil trunc")},
    **{name: getattr(math, name) for name in split_names("cbrt atan tanh asinh atan2")},
    "abs": abs,
    "sign": lambda x: x if x == 0 or math.isnan(x) else math.copysign(1.0, x),
    "round": _make_rounding(_round_half_up),
    "fround": _fround,
    "log1p": _make_total(math.log1p, {-1.0: -math.inf}),
    "cosh": lambda x: _make_total(math.cosh)(abs(x)),
    "atanh": _make_total(math.atanh, {1.0: math.inf, -1.0: -math.inf}),
    "pow": power,
    "hypot": lambda *numbers: math.hypot(*numbers),  # noqa: PLW0108  the built-in has no signature
    "max": find_largest,
    "min": find_smallest,
}
