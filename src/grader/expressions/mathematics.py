"""`Math`: its constants and functions. `Math.random` is left out: a lab gives the same run every time."""

import math
from collections.abc import Callable

import numpy as np

from grader.expressions.fields import names
from grader.expressions.values import power

CONSTANTS = {
    "PI": math.pi,
    "E": math.e,
    "LN2": math.log(2),
    "LN10": math.log(10),
    "LOG2E": 1.4426950408889634,
    "LOG10E": 0.4342944819032518,
    "SQRT2": math.sqrt(2),
    "SQRT1_2": math.sqrt(0.5),
}


def _total(function: Callable[[float], float]) -> Callable[[float], float]:
    """The function with NaN outside its domain, and an infinity of the argument's sign beyond the largest number."""

    def called(x: float) -> float:
        try:
            return function(x)
        except ValueError:
            return math.nan
        except OverflowError:
            return math.copysign(math.inf, x)

    return called


def _log(function: Callable[[float], float], pole: float = 0.0) -> Callable[[float], float]:
    """A logarithm: -Infinity at its pole, NaN below it."""
    return lambda x: -math.inf if x == pole else _total(function)(x)


def _rounded(function: Callable[[float], int]) -> Callable[[float], float]:
    """Rounding that keeps the sign of zero, infinities and NaN."""
    return lambda x: math.copysign(float(function(x)), x) if math.isfinite(x) else x


def _half_up(x: float) -> int:
    below = math.floor(x)
    return below + 1 if x - below >= 0.5 else below


def _fround(x: float) -> float:
    with np.errstate(over="ignore"):
        return float(np.float32(x))


ONE_ARGUMENT: dict[str, Callable[[float], float]] = {
    **{name: _total(getattr(math, name)) for name in names("sqrt exp expm1 sin cos tan asin acos sinh acosh")},
    **{name: getattr(math, name) for name in names("cbrt atan tanh asinh")},
    **{name: _rounded(getattr(math, name)) for name in names("floor ceil trunc")},
    **{name: _log(getattr(math, name)) for name in names("log log2 log10")},
    "abs": abs,
    "sign": lambda x: x if x == 0 or math.isnan(x) else math.copysign(1.0, x),
    "round": _rounded(_half_up),
    "fround": _fround,
    "log1p": _log(math.log1p, -1.0),
    "cosh": lambda x: _total(math.cosh)(abs(x)),
    "atanh": lambda x: math.copysign(math.inf, x) if abs(x) == 1 else _total(math.atanh)(x),
}


def _hypot(*numbers: float) -> float:
    return math.inf if any(map(math.isinf, numbers)) else math.hypot(*numbers)


def largest(*numbers: float) -> float:
    """`Math.max`: NaN if any is NaN; 0 is larger than -0."""
    best = -math.inf
    for x in numbers:
        if x > best or (x == best == 0 and math.copysign(1.0, x) > 0):
            best = x
        elif math.isnan(x):
            return x
    return best


def smallest(*numbers: float) -> float:
    """`Math.min`: NaN if any is NaN; -0 is smaller than 0."""
    return -largest(*[-x for x in numbers])


FUNCTIONS: dict[str, tuple[int | None, Callable[..., float]]] = {
    **{name: (1, function) for name, function in ONE_ARGUMENT.items()},
    "atan2": (2, math.atan2),
    "pow": (2, power),
    "hypot": (None, _hypot),
    "max": (None, largest),
    "min": (None, smallest),
}
"""How many arguments a function takes (None: any number), and the function, of floats."""
