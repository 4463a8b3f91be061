"""The operators, with JavaScript's meaning where it differs from Python's."""

import math
import operator
from collections.abc import Callable
from typing import Any

from grader.expressions.values import (
    UNDEFINED,
    Object,
    Value,
    bounded,
    to_int32,
    to_number,
    to_primitive,
    to_string,
)


def add(left: Value, right: Value) -> Value:
    """`left + right`: text joins, everything else adds."""
    left, right = to_primitive(left), to_primitive(right)
    if isinstance(left, str) or isinstance(right, str):
        return bounded(to_string(left) + to_string(right))
    return to_number(left) + to_number(right)


def divide(a: float, b: float) -> float:
    """`a / b`; division by zero gives an infinity or NaN."""
    if b:
        return a / b
    if a == 0 or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def remainder(a: float, b: float) -> float:
    """`a % b`: the sign is the dividend's."""
    return math.nan if b == 0 or math.isinf(a) else math.fmod(a, b)


def power(base: float, exponent: float) -> float:
    """`base ** exponent`; (+-1) ** Infinity is NaN, unlike in C. Source: ECMA-262, Number::exponentiate."""
    if math.isnan(exponent) or (abs(base) == 1 and math.isinf(exponent)):
        return math.nan
    odd = math.isfinite(exponent) and math.fmod(exponent, 2) in (1.0, -1.0)
    sign = -1.0 if odd and math.copysign(1.0, base) < 0 else 1.0
    if base == 0 and exponent < 0:
        return sign * math.inf
    try:
        return math.pow(base, exponent)
    except OverflowError:
        return sign * math.inf
    except ValueError:
        return math.nan


def strictly_equal(left: Value, right: Value) -> bool:
    """`left === right`."""
    if isinstance(left, Object) or isinstance(right, Object):
        return left is right
    return type(left) is type(right) and left == right


def loosely_equal(left: Value, right: Value) -> bool:
    """`left == right`."""
    if left is None or left is UNDEFINED:
        return right is None or right is UNDEFINED
    if right is None or right is UNDEFINED:
        return False
    both_objects = isinstance(left, Object) and isinstance(right, Object)
    if both_objects or type(left) is type(right):
        return strictly_equal(left, right)
    left, right = to_primitive(left), to_primitive(right)
    return left == right if type(left) is type(right) else to_number(left) == to_number(right)


def ordered(compare: Callable[[Any, Any], bool]) -> Callable[[Value, Value], bool]:
    """A comparison such as `left < right`: two texts by code unit, everything else as numbers; false with NaN."""

    def compared(left: Value, right: Value) -> bool:
        left, right = to_primitive(left), to_primitive(right)
        if isinstance(left, str) and isinstance(right, str):
            return compare(left, right)
        return compare(to_number(left), to_number(right))

    return compared


BINARY: dict[str, Callable[[Any, Any], Value]] = {
    "+": add,
    "/": divide,
    "%": remainder,
    "**": power,
    "==": loosely_equal,
    "!=": lambda a, b: not loosely_equal(a, b),
    "===": strictly_equal,
    "!==": lambda a, b: not strictly_equal(a, b),
    "<": ordered(operator.lt),
    "<=": ordered(operator.le),
    ">": ordered(operator.gt),
    ">=": ordered(operator.ge),
    "&": lambda a, b: float(to_int32(a) & to_int32(b)),
    "|": lambda a, b: float(to_int32(a) | to_int32(b)),
    "^": lambda a, b: float(to_int32(a) ^ to_int32(b)),
    "<<": lambda a, b: float(to_int32(float(to_int32(a) << (to_int32(b) & 31)))),
    ">>": lambda a, b: float(to_int32(a) >> (to_int32(b) & 31)),
    ">>>": lambda a, b: float((to_int32(a) & 0xFFFFFFFF) >> (to_int32(b) & 31)),
}
"""`-` and `*` are not here: compiled code converts both sides and uses Python's own. It converts both sides of every
other operator of numbers, too."""
