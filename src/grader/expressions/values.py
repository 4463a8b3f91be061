"""The values of the language, JavaScript's rules for converting them, and its operators. A number is a float, null is
None, a text is a str with one character per UTF-16 code unit; arrays are lists, typed arrays are Vectors, results with
named parts are Records."""

import math
import operator
import re
from collections.abc import Callable, Collection, Iterator
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from grader.expressions.texts import number_to_string

LENGTH_MAX = 10_000


class RunError(Exception):
    """Evaluating an expression failed. The source position is added when the error leaves the program."""


class Undefined:
    """The type of `undefined`, which has one value."""

    def __repr__(self) -> str:
        return "undefined"


UNDEFINED = Undefined()


class Vector:
    """A typed array: a flat view of one field of the model or the data, or a copy (from slice and map). The elements of
    `view` are Python floats; integers or booleans where `whole`."""

    __slots__ = ("name", "view", "whole", "writable")

    def __init__(self, array: NDArray[Any], name: str = "", writable: bool = True) -> None:
        flat = array.reshape(-1)
        assert flat.size == 0 or np.shares_memory(flat, array), f"{name} is not contiguous"
        self.view: memoryview[Any] = memoryview(cast(Any, flat))
        self.whole = self.view.format not in ("d", "f")
        self.name = name
        self.writable = writable

    def __len__(self) -> int:
        return len(self.view)

    def __getitem__(self, position: int) -> float:
        return float(self.view[position])

    def __setitem__(self, position: int, value: "Value") -> None:
        """Store a value as the array's type does. Raises RunError where it cannot be changed."""
        if not self.writable:
            raise RunError(f"{self.name or 'this array'} cannot be changed")
        self.view[position] = element(self.view, to_number(value))

    def __iter__(self) -> Iterator[float]:
        return map(float, self.view)

    def part(self, places: slice) -> "Vector":
        """Returns a view of some elements, which shares their memory."""
        return Vector(np.asarray(self.view)[places], self.name, self.writable)

    def like(self, values: list["Value"]) -> "Vector":
        """Returns a new typed array of the same type."""
        vector = Vector(np.empty(len(values), np.asarray(self.view).dtype))
        for i, value in enumerate(values):
            vector[i] = value
        return vector


class Record(dict[str, Any]):
    """Named parts, which programs only read: a result such as lib.energy(), or the options of a call."""


Object = (list, Vector, Record)
"""The types of values that are equal only to themselves."""

Value = float | bool | str | None | Undefined | list[Any] | Vector | Record
Sequence = TypeVar("Sequence", bound=str | list[Any])


def list_items(array: Value) -> list[Any]:
    """Returns the elements of an array (the array itself) or of a typed array (a copy); none of anything else."""
    return list(array) if isinstance(array, Vector) else array if isinstance(array, list) else []


def element(view: "memoryview[Any]", number: float) -> float | int:
    """Returns a number as a typed array of this type stores it."""
    if view.format in ("d", "f"):
        return number
    whole = wrap_float(number, 8 * view.itemsize, view.format in ("b", "h", "i", "l", "q"))
    return bool(whole) if view.format == "?" else whole


def wrap_float(number: float, bits: int, signed: bool) -> int:
    """Returns the integer of so many bits that a number becomes; integers wrap. Source: ECMA-262, ToInt32 and kin."""
    whole = math.trunc(number) % (1 << bits) if math.isfinite(number) else 0
    return whole - (1 << bits) if signed and whole >> (bits - 1) else whole


def type_name(value: Value) -> str:
    """Returns the result of `typeof`."""
    return {bool: "boolean", float: "number", str: "string", Undefined: "undefined"}.get(type(value), "object")


def is_nan(value: Value) -> bool:
    """Whether a value is the number NaN."""
    return isinstance(value, float) and math.isnan(value)


def to_boolean(value: Value) -> bool:
    """Truthiness: 0, NaN, '', null and undefined are false; arrays are true even when empty."""
    if isinstance(value, Object):
        return True
    return bool(value) and not is_nan(value) and value is not UNDEFINED


WHITESPACE = "\t\n\v\f\r \u00a0\u1680\u2028\u2029\u202f\u205f\u3000\ufeff" + "".join(map(chr, range(0x2000, 0x200B)))
DECIMAL = re.compile(r"[+-]?(?:Infinity|(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)", re.ASCII)
RADIX = re.compile(r"0(?:[xX][0-9a-fA-F]+|[oO][0-7]+|[bB][01]+)", re.ASCII)


def text_to_number(text: str) -> float:
    """`Number(text)`: NaN where the text is not a number."""
    text = text.strip(WHITESPACE)
    if not text:
        return 0.0
    if DECIMAL.fullmatch(text):
        return float(text.replace("Infinity", "inf"))
    try:
        return float(int(text, 0)) if RADIX.fullmatch(text) else math.nan
    except OverflowError:
        return math.inf


def to_number(value: Value) -> float:
    """`Number(value)`."""
    if isinstance(value, float):
        return value
    if isinstance(value, bool) or value is None:
        return float(value or 0)
    return math.nan if value is UNDEFINED else text_to_number(to_string(value))


def to_numbers(column: Collection[Value]) -> NDArray[np.float64]:
    """`Number(value)` of each of many values, as an array (n,)."""
    numbers = column if set(map(type, column)) == {float} else [to_number(value) for value in column]
    return np.array(numbers, dtype=np.float64)


def to_string(value: Value) -> str:
    """`String(value)`; arrays are joined with commas."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return number_to_string(value)
    if isinstance(value, list | Vector):
        return join(list_items(value), ",", 0)
    return {Record: "[object Object]", Undefined: "undefined"}.get(type(value), "null")


def join(items: list[Value], separator: str, depth: int) -> str:
    """`items.join(separator)`: null and undefined are empty. A list inside itself ends here with an error."""
    if depth > 20:
        raise RunError("an array that holds itself has no text")
    text = ""
    for i, item in enumerate(items):
        if i:
            text += separator
        if isinstance(item, list):
            text += join(item, ",", depth + 1)
        elif item is not None and item is not UNDEFINED:
            text += to_string(item)
        check_length(text)
    return text


def measure_weight(value: Value) -> int:
    """Returns the cost of going through a whole value once, in ticks."""
    return len(value) // 16 if isinstance(value, str | list | Vector) else 0


def check_length(sequence: Sequence) -> Sequence:
    """Returns the text or array, unless it has grown past LENGTH_MAX."""
    if len(sequence) > LENGTH_MAX:
        what, parts = ("a text", "characters") if isinstance(sequence, str) else ("an array", "elements")
        raise RunError(f"{what} grew past {LENGTH_MAX} {parts}")
    return sequence


def to_primitive(value: Value) -> Value:
    """Arrays and records become text; the rest stays."""
    return to_string(value) if isinstance(value, Object) else value


def to_int32(value: Value) -> int:
    """Returns the signed 32-bit integer that bitwise operators work on."""
    return wrap_float(to_number(value), 32, signed=True)


def to_index(value: Value, fallback: int = 0) -> int:
    """`ToIntegerOrInfinity`, as an int (infinities become very large); undefined gives `fallback`."""
    if value is UNDEFINED:
        return fallback
    number = to_number(value)
    return 0 if math.isnan(number) else int(max(-1e18, min(1e18, number)))


def to_units(text: str) -> str:
    """The text with one character per UTF-16 code unit, which is how JavaScript counts and how programs hold it."""
    if text.isascii():
        return text
    units = text.encode("utf-16-le", "surrogatepass")
    return "".join(chr(units[i] | units[i + 1] << 8) for i in range(0, len(units), 2))


def from_units(text: str) -> str:
    """Returns the inverse of `to_units`: pairs of code units become one character, a lone half becomes U+FFFD."""
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")


def _read_position(index: Value) -> int | None:
    """Returns the element that an index means; None for numbers that mean none, such as 0.5 or NaN."""
    if isinstance(index, str) and index.isascii() and index.isdigit() and str(int(index[:9])) == index:
        return int(index)
    if not isinstance(index, float):
        raise RunError(f"an element is named by a whole number, not by {to_string(index)[:40]}")
    return int(index) if index.is_integer() else None


def read_index(value: Value, index: Value) -> Value:
    """`value[index]`: undefined out of range."""
    if value is None or value is UNDEFINED:
        raise RunError(f"{to_string(value)} has no elements")
    position = _read_position(index)
    if position is None or not isinstance(value, str | list | Vector) or not 0 <= position < len(value):
        return UNDEFINED
    return value[position]


def write_index(value: Value, index: Value, new: Value) -> Value:
    """`value[index] = new`, as the array's type stores it; out of range is an error, where a browser ignores it."""
    if not isinstance(value, list | Vector):
        raise RunError(f"elements of {to_string(value)[:40]} cannot be assigned")
    position = _read_position(index)
    if position is None or not 0 <= position < len(value):
        name = (isinstance(value, Vector) and value.name) or "the array"
        raise RunError(f"index {to_string(index)} is outside {name}, which has {len(value)} elements")
    value[position] = new
    return new


def add(left: Value, right: Value) -> Value:
    """`left + right`: text joins, everything else adds."""
    left, right = to_primitive(left), to_primitive(right)
    if isinstance(left, str) or isinstance(right, str):
        return check_length(to_string(left) + to_string(right))
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
    missing = [value is None or value is UNDEFINED for value in (left, right)]
    if any(missing):
        return all(missing)
    if isinstance(left, Object) and isinstance(right, Object):
        return left is right
    left, right = to_primitive(left), to_primitive(right)
    return left == right if type(left) is type(right) else to_number(left) == to_number(right)


def make_order(compare: Callable[[Any, Any], bool]) -> Callable[[Value, Value], bool]:
    """A comparison such as `left < right`: two texts by code unit, everything else as numbers; false with NaN."""

    def compared(left: Value, right: Value) -> bool:
        left, right = to_primitive(left), to_primitive(right)
        if isinstance(left, str) and isinstance(right, str):
            return compare(left, right)
        return compare(to_number(left), to_number(right))

    return compared


BINARY: dict[str, Callable[[Any, Any], Value]] = {
    "+": add, "/": divide, "%": remainder, "**": power, "==": loosely_equal, "!=": lambda a, b: not loosely_equal(a, b),
    "===": strictly_equal, "!==": lambda a, b: not strictly_equal(a, b), "<": make_order(operator.lt),
    "<=": make_order(operator.le), ">": make_order(operator.gt), ">=": make_order(operator.ge),
    "&": lambda a, b: float(to_int32(a) & to_int32(b)), "|": lambda a, b: float(to_int32(a) | to_int32(b)),
    "^": lambda a, b: float(to_int32(a) ^ to_int32(b)),
    "<<": lambda a, b: float(to_int32(float(to_int32(a) << (to_int32(b) & 31)))),
    ">>": lambda a, b: float(to_int32(a) >> (to_int32(b) & 31)),
    ">>>": lambda a, b: float((to_int32(a) & 0xFFFFFFFF) >> (to_int32(b) & 31)),
}  # fmt: skip
"""`-` and `*` are not here: compiled code converts both sides and uses Python's own. It converts both sides of every
other operator of numbers, too."""
