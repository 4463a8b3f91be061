"""The operators, with JavaScript's meaning where it differs from Python's."""

import math
from collections.abc import Callable

from grader.labs.values import (
    UNDEFINED,
    Record,
    Value,
    Vector,
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


def subtract(left: Value, right: Value) -> float:
    """`left - right`."""
    return to_number(left) - to_number(right)


def multiply(left: Value, right: Value) -> float:
    """`left * right`."""
    return to_number(left) * to_number(right)


def divide(left: Value, right: Value) -> float:
    """`left / right`; division by zero gives an infinity or NaN."""
    a, b = to_number(left), to_number(right)
    if b != 0:
        return a / b
    if a == 0 or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def remainder(left: Value, right: Value) -> float:
    """`left % right`: the sign is the dividend's."""
    a, b = to_number(left), to_number(right)
    if b == 0 or math.isinf(a) or math.isnan(a) or math.isnan(b):
        return math.nan
    return math.fmod(a, b)


def power(left: Value, right: Value) -> float:
    """`left ** right`; (+-1) ** Infinity is NaN, unlike in C. Source: ECMA-262, Number::exponentiate."""
    base, exponent = to_number(left), to_number(right)
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
    if isinstance(left, list | Vector | Record) or isinstance(right, list | Vector | Record):
        return left is right
    return type(left) is type(right) and left == right


def loosely_equal(left: Value, right: Value) -> bool:
    """`left == right`."""
    if left is None or left is UNDEFINED:
        return right is None or right is UNDEFINED
    if right is None or right is UNDEFINED:
        return False
    both_objects = isinstance(left, list | Vector | Record) and isinstance(right, list | Vector | Record)
    if both_objects or type(left) is type(right):
        return strictly_equal(left, right)
    left, right = to_primitive(left), to_primitive(right)
    return left == right if type(left) is type(right) else to_number(left) == to_number(right)


def less(left: Value, right: Value) -> bool:
    """`left < right`: two texts by code unit, everything else as numbers."""
    left, right = to_primitive(left), to_primitive(right)
    if isinstance(left, str) and isinstance(right, str):
        return left < right
    return to_number(left) < to_number(right)


def less_or_equal(left: Value, right: Value) -> bool:
    """`left <= right`; false with NaN."""
    left, right = to_primitive(left), to_primitive(right)
    if isinstance(left, str) and isinstance(right, str):
        return left <= right
    return to_number(left) <= to_number(right)


def _shift_left(left: Value, right: Value) -> float:
    return float(to_int32(float(to_int32(left) << (to_int32(right) & 31))))


def _shift_right_unsigned(left: Value, right: Value) -> float:
    return float((to_int32(left) & 0xFFFFFFFF) >> (to_int32(right) & 31))


BINARY: dict[str, Callable[[Value, Value], Value]] = {
    "+": add,
    "-": subtract,
    "*": multiply,
    "/": divide,
    "%": remainder,
    "**": power,
    "==": loosely_equal,
    "!=": lambda a, b: not loosely_equal(a, b),
    "===": strictly_equal,
    "!==": lambda a, b: not strictly_equal(a, b),
    "<": less,
    "<=": less_or_equal,
    ">": lambda a, b: less(b, a),
    ">=": lambda a, b: less_or_equal(b, a),
    "&": lambda a, b: float(to_int32(a) & to_int32(b)),
    "|": lambda a, b: float(to_int32(a) | to_int32(b)),
    "^": lambda a, b: float(to_int32(a) ^ to_int32(b)),
    "<<": _shift_left,
    ">>": lambda a, b: float(to_int32(a) >> (to_int32(b) & 31)),
    ">>>": _shift_right_unsigned,
}
