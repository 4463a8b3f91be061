"""The methods that values have. Everything else, prototypes included, does not exist."""

import functools
import math
from collections.abc import Callable
from typing import Any

from grader.expressions.machine import Machine, lenient
from grader.expressions.operators import strictly_equal
from grader.expressions.texts import to_exponential, to_fixed, to_precision
from grader.expressions.values import (
    STRING_MAX,
    UNDEFINED,
    WHITESPACE,
    Trouble,
    Undefined,
    Value,
    Vector,
    bounded,
    bounded_list,
    from_units,
    in_units,
    items_of,
    join,
    to_boolean,
    to_index,
    to_number,
    to_string,
    type_name,
    weight,
)

Callback = Callable[..., Value]
Items = list[Value]


def _span(length: int, start: Value = UNDEFINED, end: Value = UNDEFINED) -> slice:
    """The elements from `start` to `end`, which may be missing or count from the back."""

    def clamp(k: int) -> int:
        return max(0, length + k) if k < 0 else min(k, length)

    return slice(clamp(to_index(start)), clamp(to_index(end, length)))


def _at(sequence: str | Items, index: Value = UNDEFINED) -> Value:
    k = to_index(index)
    k += len(sequence) if k < 0 else 0
    return sequence[k] if 0 <= k < len(sequence) else UNDEFINED


def _like(this: Value, items: Items) -> Value:
    """A typed array makes typed arrays, an array makes arrays."""
    return this.like(items) if isinstance(this, Vector) else bounded_list(items)


def _turns(this: Value, f: Callback) -> list[tuple[Value, float, Value]]:
    """For each element in turn: the element, its index, and what the callback makes of element, index and array."""
    return [(x, float(i), f(x, float(i), this)) for i, x in enumerate(list(items_of(this)))]


def _first(this: Value, f: Callback) -> tuple[Value, float]:
    """The first element that the callback accepts, and its index; undefined and -1 where it accepts none."""
    turns = ((x, float(i)) for i, x in enumerate(list(items_of(this))) if to_boolean(f(x, float(i), this)))
    return next(turns, (UNDEFINED, -1.0))


def _for_each(this: Value, f: Callback) -> Value:
    _turns(this, f)
    return UNDEFINED


def _reduce(this: Value, f: Callback, *initial: Value) -> Value:
    turns = [(x, float(i)) for i, x in enumerate(items_of(this))]
    if not turns and not initial:
        raise Trouble("reduce of an empty array needs an initial value")
    total = initial[0] if initial else turns.pop(0)[0]
    for x, i in turns:
        total = f(total, x, i, this)
    return total


def _order(f: Callback) -> Callable[[Value, Value], int]:
    def order(a: Value, b: Value) -> int:
        sign = to_number(f(a, b))
        return (sign > 0) - (sign < 0)

    return order


def _numeric_order(x: Value) -> tuple[bool, float, float]:
    """-0 before 0, NaN last."""
    number = to_number(x)
    return math.isnan(number), number, math.copysign(1.0, number)


def _sort(this: Value, f: Callback | None = None) -> Value:
    """In place; without a comparison arrays sort as text and typed arrays as numbers; undefined comes last."""
    items = items_of(this)
    defined = [x for x in items if x is not UNDEFINED]
    if f is not None:
        defined.sort(key=functools.cmp_to_key(_order(f)))
    else:
        defined.sort(key=_numeric_order if isinstance(this, Vector) else to_string)
    return _store(this, defined + [UNDEFINED] * (len(items) - len(defined)))


def _store(this: Value, items: Items, start: int = 0) -> Value:
    """Write elements in place."""
    if isinstance(this, Vector):
        for i, x in enumerate(items, start):
            this.write(i, x)
    elif isinstance(this, list):
        this[start : start + len(items)] = items
    return this


def _fill(this: Value, value: Value = UNDEFINED, start: Value = UNDEFINED, end: Value = UNDEFINED) -> Value:
    span = _span(len(items_of(this)), start, end)
    return _store(this, [value] * (span.stop - span.start), span.start)


def _index_of(this: Value, wanted: Value = UNDEFINED, start: Value = UNDEFINED) -> Value:
    items = items_of(this)
    first = _span(len(items), start).start
    return next((float(i) for i in range(first, len(items)) if strictly_equal(items[i], wanted)), -1.0)


def _includes(this: Value, wanted: Value = UNDEFINED, start: Value = UNDEFINED) -> Value:
    items = items_of(this)
    nan = isinstance(wanted, float) and math.isnan(wanted)
    return any(
        strictly_equal(x, wanted) or (nan and isinstance(x, float) and math.isnan(x))
        for x in items[_span(len(items), start)]
    )


def _concat(this: Value, *others: Value) -> Value:
    joined = list(items_of(this))
    for other in others:
        joined.extend(other if isinstance(other, list) else [other])
        bounded_list(joined)
    return joined


def _add(this: Items, at: int, values: tuple[Value, ...]) -> Value:
    this[at:at] = values
    return float(len(bounded_list(this)))


def _set(this: Vector, source: Value = UNDEFINED, offset: Value = 0.0) -> Value:
    if not isinstance(source, list | Vector):
        raise Trouble("set() copies an array")
    items, start = list(items_of(source)), to_index(offset)
    if start < 0 or start + len(items) > len(this):
        raise Trouble(f"{len(items)} elements from {start} do not fit into {this.name}, which has {len(this)}")
    _store(this, items, start)
    return UNDEFINED


def _subarray(this: Vector, start: Value = UNDEFINED, end: Value = UNDEFINED) -> Value:
    span = _span(len(this), start, end)
    return this.part(span.start, max(span.start, span.stop))


SHARED: dict[str, Callable[..., Value]] = {
    "map": lambda this, f: _like(this, [result for _, _, result in _turns(this, f)]),
    "filter": lambda this, f: _like(this, [x for x, _, result in _turns(this, f) if to_boolean(result)]),
    "forEach": _for_each,
    "reduce": _reduce,
    "some": lambda this, f: _first(this, f)[1] >= 0,
    "every": lambda this, f: _first(this, lambda *turn: not to_boolean(f(*turn)))[1] < 0,
    "find": lambda this, f: _first(this, f)[0],
    "findIndex": lambda this, f: _first(this, f)[1],
    "sort": _sort,
    "reverse": lambda this: _store(this, items_of(this)[::-1]),
    "fill": _fill,
    "slice": lambda this, start=UNDEFINED, end=UNDEFINED: _like(
        this, items_of(this)[_span(len(items_of(this)), start, end)]
    ),
    "indexOf": _index_of,
    "includes": _includes,
    "at": lambda this, index=UNDEFINED: _at(items_of(this), index),
    "join": lambda this, separator=UNDEFINED: join(
        items_of(this), "," if separator is UNDEFINED else to_string(separator), 0
    ),
}
ARRAY: dict[str, Callable[..., Value]] = {
    **SHARED,
    "concat": _concat,
    "push": lambda this, *values: _add(this, len(this), values),
    "unshift": lambda this, *values: _add(this, 0, values),
    "pop": lambda this: this.pop() if this else UNDEFINED,
    "shift": lambda this: this.pop(0) if this else UNDEFINED,
}
TYPED_ARRAY: dict[str, Callable[..., Value]] = {**SHARED, "set": _set, "subarray": _subarray}
CALLBACK_METHODS = frozenset(["map", "filter", "forEach", "reduce", "some", "every", "find", "findIndex", "sort"])


def _repeat(this: str, count: Value = UNDEFINED) -> Value:
    times = to_index(count)
    if times < 0:
        raise Trouble("a text cannot be repeated a negative number of times")
    return bounded(this * min(times, STRING_MAX + 1))


def _padding(this: str, width: Value, pad: Value) -> str:
    filler = " " if pad is UNDEFINED else to_string(pad)
    missing = max(0, min(to_index(width), STRING_MAX + 1) - len(this))
    return (filler * (missing // max(1, len(filler)) + 1))[:missing]


def _from(this: str, start: Value) -> str:
    return this[max(0, to_index(start)) :]


TEXT: dict[str, Callable[..., Value]] = {
    "slice": lambda this, start=UNDEFINED, end=UNDEFINED: this[_span(len(this), start, end)],
    "indexOf": lambda this, wanted=UNDEFINED, start=UNDEFINED: float(
        this.find(to_string(wanted), max(0, min(to_index(start), len(this))))
    ),
    "includes": lambda this, wanted=UNDEFINED, start=UNDEFINED: to_string(wanted) in _from(this, start),
    "startsWith": lambda this, wanted=UNDEFINED, start=UNDEFINED: _from(this, start).startswith(to_string(wanted)),
    "endsWith": lambda this, wanted=UNDEFINED, end=UNDEFINED: this[: max(0, to_index(end, len(this)))].endswith(
        to_string(wanted)
    ),
    "at": _at,
    "charAt": lambda this, index=UNDEFINED: "" if to_index(index) < 0 else this[to_index(index) :][:1],
    "concat": lambda this, *others: bounded(this + "".join(map(to_string, others))),
    "toUpperCase": lambda this: bounded(in_units(from_units(this).upper())),
    "toLowerCase": lambda this: bounded(in_units(from_units(this).lower())),
    "trim": lambda this: this.strip(WHITESPACE),
    "repeat": _repeat,
    "padStart": lambda this, width=UNDEFINED, pad=UNDEFINED: bounded(_padding(this, width, pad) + this),
    "padEnd": lambda this, width=UNDEFINED, pad=UNDEFINED: bounded(this + _padding(this, width, pad)),
}
NUMBER: dict[str, Callable[..., Value]] = {
    "toFixed": lambda this, digits=UNDEFINED: to_fixed(this, _digits(digits, 0)),
    "toExponential": lambda this, places=UNDEFINED: to_exponential(
        this, None if places is UNDEFINED or not math.isfinite(this) else _digits(places, 0)
    ),
    "toPrecision": lambda this, count=UNDEFINED: to_precision(
        this, None if count is UNDEFINED or not math.isfinite(this) else _digits(count, 1)
    ),
}


def _digits(value: Value, low: int) -> int:
    digits = to_index(value)
    if not low <= digits <= 100:
        raise Trouble(f"the number of digits must be from {low} to 100")
    return digits


OF_TYPE: dict[type, dict[str, Callable[..., Value]]] = {
    kind: {name: lenient(method) for name, method in {**methods, "toString": to_string}.items()}
    for kind, methods in {float: NUMBER, bool: {}, str: TEXT, list: ARRAY, Vector: TYPED_ARRAY}.items()
}
NAMES = frozenset(name for methods in OF_TYPE.values() for name in methods)


def call_method(m: Machine, this: Value, name: str, args: list[Any]) -> Value:
    """`this.name(...args)`. Raises Trouble where the value has no such method."""
    method = OF_TYPE.get(type(this), {}).get(name)
    if method is None:
        what = to_string(this) if this is None or isinstance(this, Undefined) else f"this {type_name(this)}"
        raise Trouble(f"{what} has no method {name}")
    m.tick(1 + weight(this) + (len(items_of(this)) if name == "sort" else 0))
    return method(this, *args)
