"""The methods that values have. Everything else, prototypes included, does not exist."""

import functools
import math
from collections.abc import Callable
from typing import Any

from grader.expressions import values
from grader.expressions.machine import Machine, lenient
from grader.expressions.texts import to_exponential, to_fixed, to_precision
from grader.expressions.values import UNDEFINED, Trouble, Value, Vector, bounded, items_of, to_index, to_string

Callback = Callable[..., Value]
Items = list[Value]


def _span(start: Value, end: Value = UNDEFINED) -> slice:
    """The elements from `start` to `end`, which may be missing or count from the back, as in Python."""
    return slice(to_index(start), None if end is UNDEFINED else to_index(end))


def _at(sequence: str | Items, index: Value) -> Value:
    k = to_index(index)
    return sequence[k] if -len(sequence) <= k < len(sequence) else UNDEFINED


def _like(this: Value, items: Items) -> Value:
    """A typed array makes typed arrays, an array makes arrays."""
    return this.like(items) if isinstance(this, Vector) else bounded(items)


def _turns(this: Value, f: Callback) -> list[tuple[Value, float, Value]]:
    """For each element in turn: the element, its index, and what the callback makes of element, index and array."""
    return [(x, float(i), f(x, float(i), this)) for i, x in enumerate(list(items_of(this)))]


def _first(this: Value, f: Callback) -> tuple[Value, float]:
    """The first element that the callback accepts, and its index; undefined and -1 where it accepts none."""
    turns = ((x, float(i)) for i, x in enumerate(list(items_of(this))) if values.to_boolean(f(x, float(i), this)))
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


def _numeric_order(x: Value) -> tuple[bool, float, float]:
    """-0 before 0, NaN last."""
    number = values.to_number(x)
    return math.isnan(number), number, math.copysign(1.0, number)


def _sort(this: Value, f: Callback | None = None) -> Value:
    """In place; without a comparison arrays sort as text and typed arrays as numbers; undefined comes last."""
    items = items_of(this)
    defined = [x for x in items if x is not UNDEFINED]
    if f is not None:
        defined.sort(
            key=functools.cmp_to_key(lambda a, b: -(values.to_number(f(a, b)) < 0))
        )  # sort asks only what is less
    else:
        defined.sort(key=_numeric_order if isinstance(this, Vector) else to_string)
    return _store(this, defined + [UNDEFINED] * (len(items) - len(defined)))


def _store(this: Value, items: Items, start: int = 0) -> Value:
    """Write elements in place."""
    if isinstance(this, Vector):
        for i, x in enumerate(items, start):
            values.write_index(this, float(i), x)
    elif isinstance(this, list):
        this[start : start + len(items)] = items
    return this


def _fill(this: Value, value: Value, start: Value, end: Value) -> Value:
    places = range(len(items_of(this)))[_span(start, end)]
    return _store(this, [value] * len(places), places.start)


def _index_of(this: Value, wanted: Value, start: Value) -> Value:
    items = items_of(this)
    return next((float(i) for i in range(len(items))[_span(start)] if values.strictly_equal(items[i], wanted)), -1.0)


def _includes(this: Value, wanted: Value, start: Value) -> Value:
    """Unlike for `===`, NaN is equal to NaN here."""
    items = items_of(this)[_span(start)]
    return (
        any(map(values.is_nan, items))
        if values.is_nan(wanted)
        else any(values.strictly_equal(x, wanted) for x in items)
    )


def _concat(this: Value, *others: Value) -> Value:
    joined = list(items_of(this))
    for other in others:
        joined.extend(other if isinstance(other, list) else [other])
        bounded(joined)
    return joined


def _add(this: Items, at: int, added: tuple[Value, ...]) -> Value:
    this[at:at] = added
    return float(len(bounded(this)))


def _set(this: Vector, source: Value, offset: Value = 0.0) -> Value:
    if not isinstance(source, list | Vector):
        raise Trouble("set() copies an array")
    items, start = list(items_of(source)), to_index(offset)
    if start < 0 or start + len(items) > len(this):
        raise Trouble(f"{len(items)} elements from {start} do not fit into {this.name}, which has {len(this)}")
    _store(this, items, start)
    return UNDEFINED


def _subarray(this: Vector, start: Value, end: Value) -> Value:
    places = range(len(this))[_span(start, end)]
    return this.part(places.start, places.start + len(places))


SHARED: dict[str, Callable[..., Value]] = {
    "map": lambda this, f: _like(this, [result for _, _, result in _turns(this, f)]),
    "filter": lambda this, f: _like(this, [x for x, _, result in _turns(this, f) if values.to_boolean(result)]),
    "forEach": _for_each,
    "reduce": _reduce,
    "some": lambda this, f: _first(this, f)[1] >= 0,
    "every": lambda this, f: _first(this, lambda *turn: not values.to_boolean(f(*turn)))[1] < 0,
    "find": lambda this, f: _first(this, f)[0],
    "findIndex": lambda this, f: _first(this, f)[1],
    "sort": _sort,
    "reverse": lambda this: _store(this, items_of(this)[::-1]),
    "fill": _fill,
    "slice": lambda this, start, end: _like(this, items_of(this)[_span(start, end)]),
    "indexOf": _index_of,
    "includes": _includes,
    "at": lambda this, index: _at(items_of(this), index),
    "join": lambda this, by: values.join(items_of(this), "," if by is UNDEFINED else to_string(by), 0),
}
ARRAY: dict[str, Callable[..., Value]] = {
    **SHARED,
    "concat": _concat,
    "push": lambda this, *added: _add(this, len(this), added),
    "unshift": lambda this, *added: _add(this, 0, added),
    "pop": lambda this: this.pop() if this else UNDEFINED,
    "shift": lambda this: this.pop(0) if this else UNDEFINED,
}
TYPED_ARRAY: dict[str, Callable[..., Value]] = {**SHARED, "set": _set, "subarray": _subarray}
CALLBACK_METHODS = frozenset(["map", "filter", "forEach", "reduce", "some", "every", "find", "findIndex", "sort"])


def _repeat(this: str, count: Value) -> Value:
    times = to_index(count)
    if times < 0:
        raise Trouble("a text cannot be repeated a negative number of times")
    return bounded(this * min(times, values.LENGTH_MAX + 1))


def _padding(this: str, width: Value, pad: Value) -> str:
    filler = " " if pad is UNDEFINED else to_string(pad)
    missing = max(0, min(to_index(width), values.LENGTH_MAX + 1) - len(this))
    return (filler * (missing // max(1, len(filler)) + 1))[:missing]


def _from(this: str, start: Value) -> str:
    return this[max(0, to_index(start)) :]


TEXT: dict[str, Callable[..., Value]] = {
    "slice": lambda this, start, end: this[_span(start, end)],
    "indexOf": lambda this, text, start: float(this.find(to_string(text), max(0, min(to_index(start), len(this))))),
    "includes": lambda this, text, start: to_string(text) in _from(this, start),
    "startsWith": lambda this, text, start: _from(this, start).startswith(to_string(text)),
    "endsWith": lambda this, text, end: this[: max(0, to_index(end, len(this)))].endswith(to_string(text)),
    "at": _at,
    "charAt": lambda this, index: "" if to_index(index) < 0 else this[to_index(index) :][:1],
    "concat": lambda this, *others: bounded(this + "".join(map(to_string, others))),
    "toUpperCase": lambda this: bounded(values.in_units(values.from_units(this).upper())),
    "toLowerCase": lambda this: bounded(values.in_units(values.from_units(this).lower())),
    "trim": lambda this: this.strip(values.WHITESPACE),
    "repeat": _repeat,
    "padStart": lambda this, width, pad: bounded(_padding(this, width, pad) + this),
    "padEnd": lambda this, width, pad: bounded(this + _padding(this, width, pad)),
}
NUMBER: dict[str, Callable[..., Value]] = {
    "toFixed": lambda this, places: to_fixed(this, _digits(places, 0) or 0),
    "toExponential": lambda this, places: to_exponential(this, _digits(places, 0) if math.isfinite(this) else None),
    "toPrecision": lambda this, count: to_precision(this, _digits(count, 1) if math.isfinite(this) else None),
}


def _digits(value: Value, low: int) -> int | None:
    """How many digits are asked for, if any number is."""
    if value is UNDEFINED:
        return None
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
        what = (
            to_string(this) if this is None or isinstance(this, values.Undefined) else f"this {values.type_name(this)}"
        )
        raise Trouble(f"{what} has no method {name}")
    m.tick(1 + values.weight(this) + (len(items_of(this)) if name == "sort" else 0))
    return method(this, *args)
