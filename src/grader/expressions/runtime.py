"""What compiled code calls: the parts of the language that are more than an instruction or two of Python."""

import math
from collections.abc import Iterable
from typing import Any

from grader.expressions.functions import Function, typed_array
from grader.expressions.machine import Machine, exhausted
from grader.expressions.methods import call_method
from grader.expressions.operators import BINARY
from grader.expressions.values import (
    UNDEFINED,
    Record,
    Trouble,
    Value,
    Vector,
    bounded,
    items_of,
    read_index,
    to_boolean,
    to_int32,
    to_number,
    to_string,
    type_name,
    weight,
    write_index,
)


def number(m: Machine, value: Value) -> float:
    """`Number(value)`, paid for by the length of the value."""
    m.tick(weight(value))
    return to_number(value)


def slow(m: Machine, operator: Any, left: Value, right: Value) -> Value:
    """An operator on values that are not both numbers."""
    m.tick(weight(left) + weight(right))
    result: Value = operator(left, right)
    return result


def template(m: Machine, pieces: list[Value]) -> Value:
    """The text of a template literal."""
    m.tick(sum(map(weight, pieces)))
    return bounded("".join(map(to_string, pieces)))


def spread(m: Machine, value: Value) -> list[Value]:
    """The elements of `...value`."""
    m.tick(1 + weight(value))
    if isinstance(value, list | Vector):
        return items_of(value)
    raise Trouble("only an array can be spread out")


def through(value: Value) -> Iterable[Value]:
    """What `for (const x of value)` goes through; elements that are added meanwhile are seen."""
    if isinstance(value, Vector):
        return map(float, value.view)
    if isinstance(value, list):
        return value
    raise Trouble("for ... of goes through an array")


def unpack(value: Value, count: int) -> list[Value]:
    """The first elements of an array, undefined past its end."""
    if not isinstance(value, list | Vector):
        raise Trouble("only an array can be taken apart")
    return [read_index(value, float(i)) for i in range(count)]


def put(container: Any, key: Any, value: Value) -> Value:
    """Assign an item, as an expression."""
    container[key] = value
    return value


def host(m: Machine, function: Function, args: list[Value]) -> Value:
    """Call a function of the host."""
    m.tick(function.cost + sum(map(weight, args)))
    return function.call(m, *args)


def map_from(m: Machine, function: Function, args: list[Value], callback: Any) -> Value:
    """`Array.from(array, callback)`."""
    copied = function.call(m, *args)
    assert isinstance(copied, list)
    return [callback(x, float(i)) for i, x in enumerate(copied)]


def empty_array(m: Machine, size: Value) -> Value:
    """`new Array(size)`."""
    if not isinstance(size, float) or not size.is_integer() or not 0 <= size <= 10_000:
        raise Trouble("an array here has from 0 to 10000 elements")
    m.tick(1 + int(size) // 16)
    return [UNDEFINED] * int(size)


def member(value: Value, name: str) -> Value:
    """`value.name` for the few names that values have: `length`, and the parts of a record."""
    if value is None or value is UNDEFINED:
        raise Trouble(f"{to_string(value)} has no {name}")
    if name == "length":
        return float(len(value)) if isinstance(value, str | list | Vector) else UNDEFINED
    return value.parts.get(name, UNDEFINED) if isinstance(value, Record) else UNDEFINED


OPERATORS = {operator: f"operator{i}" for i, operator in enumerate(BINARY)}
"""The name, in compiled code, of the function of each binary operator."""

FUNCTIONS = (
    *(number, slow, template, spread, through, unpack, put, host, map_from, typed_array, empty_array, member),
    *(read_index, write_index, exhausted, type_name),
)
NAMES: dict[str, object] = {
    **{function.__name__: function for function in FUNCTIONS},
    **{name: BINARY[operator] for operator, name in OPERATORS.items()},
    "array": bounded,
    "method": call_method,
    "truth": to_boolean,
    "complement": lambda value: float(~to_int32(value)),
    "tick": Machine.tick,
    "kind_of": type,
    "float_type": float,
    "undefined": UNDEFINED,
    "nan": math.nan,
}
"""Everything that compiled code can name besides its own variables and what is bound to it; it has no builtins."""
