"""The values of the expression language, and JavaScript's rules for converting and comparing them.

A number is a float, null is None, text a str with one character per UTF-16 code unit; arrays are lists, typed arrays
are Vectors, results with named parts Records.
"""

import math
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

STRING_MAX = 10_000
ARRAY_MAX = 10_000


class Trouble(Exception):
    """An expression went wrong; whoever knows the place adds it."""

    def __init__(self, why: str) -> None:
        super().__init__(why)
        self.at: tuple[int, int] | None = None


class Undefined:
    """The type of `undefined`, which has one value."""

    def __repr__(self) -> str:
        return "undefined"


UNDEFINED = Undefined()


class Vector:
    """A typed array: a flat view of one field of the model or the data (or a copy, from slice and map)."""

    __slots__ = ("array", "name", "writable")

    def __init__(self, array: NDArray[Any], name: str = "", writable: bool = True) -> None:
        flat = array.reshape(-1)
        assert flat.size == 0 or np.shares_memory(flat, array), f"{name} is not contiguous"
        self.array = flat
        self.name = name
        self.writable = writable

    def read(self, index: int) -> "Value":
        """The element, or undefined out of range."""
        return float(self.array.item(index)) if 0 <= index < self.array.size else UNDEFINED

    def write(self, index: int, value: "Value") -> None:
        """Store a number as the array's type does; past the end is an error here, unlike in a browser."""
        if not self.writable:
            raise Trouble(f"{self.name or 'this array'} cannot be changed")
        if not 0 <= index < self.array.size:
            raise Trouble(f"index {index} is outside {self.name or 'the array'}, which has {self.array.size} elements")
        self.array[index] = element(self.array.dtype, to_number(value))

    def values(self) -> list["Value"]:
        """All elements as numbers."""
        return [float(x) for x in self.array.tolist()]

    def like(self, values: list["Value"]) -> "Vector":
        """A new typed array of the same type."""
        kind = self.array.dtype
        return Vector(np.array([element(kind, to_number(v)) for v in values], dtype=kind))


class Record:
    """A result with named parts that can only be read, such as lib.energy()."""

    __slots__ = ("parts",)

    def __init__(self, **parts: "Value") -> None:
        self.parts = parts


Value = float | bool | str | None | Undefined | list[Any] | Vector | Record


def element(kind: np.dtype[Any], number: float) -> float | int:
    """A number as a typed array of this type stores it (integers wrap). Source: ECMA-262, ToInt32 and kin."""
    if kind.kind == "f":
        return float(kind.type(number)) if abs(number) < 3e38 else number
    if not math.isfinite(number):
        return 0
    bits = 8 * kind.itemsize
    whole = math.trunc(number) % (1 << bits)
    return whole - (1 << bits) if kind.kind == "i" and whole >= 1 << (bits - 1) else whole


def type_name(value: Value) -> str:
    """What `typeof` says."""
    if isinstance(value, bool):
        return "boolean"
    if isinstance(value, float):
        return "number"
    if isinstance(value, str):
        return "string"
    return "undefined" if value is UNDEFINED else "object"


def to_boolean(value: Value) -> bool:
    """Truthiness: 0, NaN, '', null and undefined are false; arrays are true even when empty."""
    if isinstance(value, bool):
        return value
    if isinstance(value, float):
        return value != 0 and not math.isnan(value)
    if isinstance(value, str):
        return value != ""
    return value is not None and value is not UNDEFINED


WHITESPACE = "\t\n\v\f\r \u00a0\u1680\u2028\u2029\u202f\u205f\u3000\ufeff" + "".join(map(chr, range(0x2000, 0x200B)))
DECIMAL = re.compile(r"[+-]?(?:Infinity|(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)", re.ASCII)
RADIX = re.compile(r"0(?:[xX][0-9a-fA-F]+|[oO][0-7]+|[bB][01]+)", re.ASCII)


def text_to_number(text: str) -> float:
    """`Number(text)`: NaN where the text is no number."""
    text = text.strip(WHITESPACE)
    if not text:
        return 0.0
    if DECIMAL.fullmatch(text):
        return float(text.replace("Infinity", "inf"))
    if RADIX.fullmatch(text):
        return float(int(text, 0))
    return math.nan


def to_number(value: Value) -> float:
    """`Number(value)`."""
    if isinstance(value, bool):
        return 1.0 if value else 0.0
    if isinstance(value, float):
        return value
    if isinstance(value, str):
        return text_to_number(value)
    if value is None:
        return 0.0
    return math.nan if value is UNDEFINED else text_to_number(to_string(value))


def number_to_string(number: float) -> str:
    """`String(number)`: the shortest digits that read back as the same number. Source: ECMA-262, Number::toString."""
    if math.isnan(number):
        return "NaN"
    if math.isinf(number):
        return "Infinity" if number > 0 else "-Infinity"
    if number == math.trunc(number) and abs(number) < 2**53:
        return str(int(number))
    sign = "-" if number < 0 else ""
    mantissa, _, exponent = repr(abs(number)).partition("e")
    whole, _, fraction = mantissa.partition(".")
    if fraction == "0":
        fraction = ""
    point = len(whole) + int(exponent or 0)
    digits = whole + fraction
    point -= len(digits) - len(digits.lstrip("0"))
    digits = digits.strip("0")
    return sign + _place_point(digits, point)


def _place_point(digits: str, point: int) -> str:
    """Decimal digits with the point after `point` of them, in exponent form where JavaScript uses it."""
    if len(digits) <= point <= 21:
        return digits + "0" * (point - len(digits))
    if 0 < point <= 21:
        return digits[:point] + "." + digits[point:]
    if -6 < point <= 0:
        return "0." + "0" * -point + digits
    exponent = point - 1
    tail = "." + digits[1:] if len(digits) > 1 else ""
    return f"{digits[0]}{tail}e{'+' if exponent > 0 else '-'}{abs(exponent)}"


def to_string(value: Value) -> str:
    """`String(value)`; arrays are joined with commas."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return number_to_string(value)
    if isinstance(value, list | Vector):
        return join(value.values() if isinstance(value, Vector) else value, ",", 0)
    return {Record: "[object Object]", Undefined: "undefined"}.get(type(value), "null")


def join(items: list[Value], separator: str, depth: int) -> str:
    """`items.join(separator)`: null and undefined are empty. A list inside itself ends here with an error."""
    if depth > 20:
        raise Trouble("an array that holds itself has no text")
    text = ""
    for i, item in enumerate(items):
        if i:
            text += separator
        if isinstance(item, list):
            text += join(item, ",", depth + 1)
        elif item is not None and item is not UNDEFINED:
            text += to_string(item)
        bounded(text)
    return text


def weight(value: Value) -> int:
    """What it costs to go through a whole value once, in ticks."""
    if isinstance(value, str | list):
        return len(value) // 16
    return value.array.size // 16 if isinstance(value, Vector) else 0


def bounded(text: str) -> str:
    """The text, unless it has grown past STRING_MAX."""
    if len(text) > STRING_MAX:
        raise Trouble(f"a text grew past {STRING_MAX} characters")
    return text


def bounded_list(items: list[Value]) -> list[Value]:
    """The array, unless it has grown past ARRAY_MAX."""
    if len(items) > ARRAY_MAX:
        raise Trouble(f"an array grew past {ARRAY_MAX} elements")
    return items


def to_primitive(value: Value) -> Value:
    """Arrays and records become text; the rest stays."""
    return to_string(value) if isinstance(value, list | Vector | Record) else value


def to_int32(value: Value) -> int:
    """The signed 32-bit integer that bitwise operators work on."""
    number = to_number(value)
    if not math.isfinite(number):
        return 0
    whole = math.trunc(number) & 0xFFFFFFFF
    return whole - 0x100000000 if whole >= 0x80000000 else whole


def to_index(value: Value, fallback: int = 0) -> int:
    """`ToIntegerOrInfinity`, as an int (infinities become very large); undefined is `fallback`."""
    if value is UNDEFINED:
        return fallback
    number = to_number(value)
    if math.isnan(number):
        return 0
    return int(max(-1e18, min(1e18, number)))


def in_units(text: str) -> str:
    """The text as JavaScript counts it: one character per UTF-16 code unit. All texts inside a program are so."""
    if text.isascii():
        return text
    units = text.encode("utf-16-le", "surrogatepass")
    return "".join(chr(units[i] | units[i + 1] << 8) for i in range(0, len(units), 2))


def from_units(text: str) -> str:
    """The text as it leaves a program: pairs of code units are one character again, a lone half is U+FFFD."""
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")
