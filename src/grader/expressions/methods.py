"""The methods that values have. Everything else, prototypes included, does not exist."""

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any, cast

from grader.expressions import values
from grader.expressions.machine import Machine, find_callback, make_lenient
from grader.expressions.texts import to_exponential, to_fixed, to_precision
from grader.expressions.values import UNDEFINED, RunError, Value, Vector, check_length, list_items, to_index, to_string

Callback = Callable[..., Value]
Items = list[Value]
Methods = dict[str, Callable[..., Value]]
"""By name: functions of the value and of the author's arguments, one of which is a function where it is called `f`."""


def _read_span(start: Value, end: Value = UNDEFINED) -> slice:
    """Returns the elements from `start` to `end`, which may be missing or count from the back, as in Python."""
    return slice(to_index(start), None if end is UNDEFINED else to_index(end))


def _at(sequence: str | Items, index: Value) -> Value:
    k = to_index(index)
    return sequence[k] if -len(sequence) <= k < len(sequence) else UNDEFINED


def _make_like(this: Value, items: Items) -> Value:
    """Returns elements in an array of the same type as the one they come from."""
    return this.like(items) if isinstance(this, Vector) else check_length(items)


def _call_for_each(this: Value, f: Callback) -> Iterator[tuple[Value, float, Value]]:
    """For each element in turn: the element, its index, and what the callback makes of element, index and array."""
    return ((x, float(i), f(x, float(i), this)) for i, x in enumerate(list(list_items(this))))


def _find_first(this: Value, f: Callback, accepted: bool = True) -> tuple[Value, float]:
    """The first element that the callback accepts (or not), and its index; undefined and -1 where there is none."""
    turns = ((x, i) for x, i, result in _call_for_each(this, f) if values.to_boolean(result) is accepted)
    return next(turns, (UNDEFINED, -1.0))


def _for_each(this: Value, f: Callback) -> Value:
    for _ in _call_for_each(this, f):
        pass
    return UNDEFINED


def _reduce(this: Value, f: Callback, *initial: Value) -> Value:
    turns = [(x, float(i)) for i, x in enumerate(list_items(this))]
    if not turns and not initial:
        raise RunError("reduce of an empty array needs an initial value")
    total = initial[0] if initial else turns.pop(0)[0]
    for x, i in turns:
        total = f(total, x, i, this)
    return total


def _order_numbers(x: Value) -> tuple[bool, float, float]:
    """-0 before 0, NaN last."""
    number = values.to_number(x)
    return math.isnan(number), number, math.copysign(1.0, number)


def _sort(this: Value, f: Callback | None = None) -> Value:
    """In place; without a comparison arrays sort as text and typed arrays as numbers; undefined comes last."""
    items = list_items(this)
    order: Callable[[Any], Any] = _order_numbers if isinstance(this, Vector) else to_string
    if f is not None:  # sort asks only what is less
        order = functools.cmp_to_key(lambda a, b: -(values.to_number(f(a, b)) < 0))
    defined = sorted((x for x in items if x is not UNDEFINED), key=order)
    return _store(this, defined + [UNDEFINED] * (len(items) - len(defined)))


def _store(this: Any, items: Items, start: int = 0) -> Value:
    """Write elements of an array or a typed array in place."""
    for i, x in enumerate(items, start):
        this[i] = x
    return cast(Value, this)


def _fill(this: Value, value: Value, start: Value, end: Value) -> Value:
    places = range(len(list_items(this)))[_read_span(start, end)]
    return _store(this, [value] * len(places), places.start)


def _index_of(this: Value, wanted: Value, start: Value, *, nan: bool = False) -> float:
    """The first index from `start` whose element is `===` to the wanted value, or both NaN where `nan`; else -1."""
    items, nan = list_items(this), nan and values.is_nan(wanted)
    same = values.is_nan if nan else functools.partial(values.strictly_equal, wanted)
    return next((float(i) for i in range(len(items))[_read_span(start)] if same(items[i])), -1.0)


def _concat(this: Value, *others: Value) -> Value:
    joined = list(list_items(this))
    for other in others:
        joined.extend(other if isinstance(other, list) else [other])
        check_length(joined)
    return joined


def _add(this: Items, at: int, added: tuple[Value, ...]) -> Value:
    this[at:at] = added
    return float(len(check_length(this)))


def _set(this: Vector, source: Value, offset: Value = 0.0) -> Value:
    if not isinstance(source, list | Vector):
        raise RunError("set() copies an array")
    items, start = list(list_items(source)), to_index(offset)
    if start < 0 or start + len(items) > len(this):
        raise RunError(f"{len(items)} elements from {start} do not fit into {this.name}, which has {len(this)}")
    _store(this, items, start)
    return UNDEFINED


SHARED: Methods = {
    "map": lambda this, f: _make_like(this, [result for _, _, result in _call_for_each(this, f)]),
    "filter": lambda this, f: _make_like(
        this, [x for x, _, result in _call_for_each(this, f) if values.to_boolean(result)]
    ),
    "forEach": _for_each,
    "reduce": _reduce,
    "some": lambda this, f: _find_first(this, f)[1] >= 0,
    "every": lambda this, f: _find_first(this, f, accepted=False)[1] < 0,
    "find": lambda this, f: _find_first(this, f)[0],
    "findIndex": lambda this, f: _find_first(this, f)[1],
    "sort": _sort,
    "reverse": lambda this: _store(this, list_items(this)[::-1]),
    "fill": _fill,
    "slice": lambda this, start, end: _make_like(this, list_items(this)[_read_span(start, end)]),
    "indexOf": _index_of,
    "includes": lambda this, wanted, start: _index_of(this, wanted, start, nan=True) >= 0,
    "at": lambda this, index: _at(list_items(this), index),
    "join": lambda this, by: values.join(list_items(this), "," if by is UNDEFINED else to_string(by), 0),
}
ARRAY: Methods = {
    **SHARED,
    "concat": _concat,
    "push": lambda this, *added: _add(this, len(this), added),
    "unshift": lambda this, *added: _add(this, 0, added),
    "pop": lambda this: this.pop() if this else UNDEFINED,
    "shift": lambda this: this.pop(0) if this else UNDEFINED,
}
TYPED_ARRAY: Methods = {**SHARED, "set": _set, "subarray": lambda this, start, end: this.part(_read_span(start, end))}


def _repeat(this: str, count: Value) -> Value:
    times = to_index(count)
    if times < 0:
        raise RunError("a text cannot be repeated a negative number of times")
    return check_length(this * min(times, values.LENGTH_MAX + 1))


def _pad(this: str, width: Value, pad: Value) -> str:
    filler = " " if pad is UNDEFINED else to_string(pad)
    missing = max(0, min(to_index(width), values.LENGTH_MAX + 1) - len(this))
    return (filler * (missing // max(1, len(filler)) + 1))[:missing]


def _from(this: str, start: Value) -> str:
    return this[max(0, to_index(start)) :]


TEXT: Methods = {
    "slice": lambda this, start, end: this[_read_span(start, end)],
    "indexOf": lambda this, text, start: float(this.find(to_string(text), max(0, min(to_index(start), len(this))))),
    "includes": lambda this, text, start: to_string(text) in _from(this, start),
    "startsWith": lambda this, text, start: _from(this, start).startswith(to_string(text)),
    "endsWith": lambda this, text, end: this[: max(0, to_index(end, len(this)))].endswith(to_string(text)),
    "at": _at,
    "charAt": lambda this, index: "" if to_index(index) < 0 else this[to_index(index) :][:1],
    "concat": lambda this, *others: check_length(this + "".join(map(to_string, others))),
    "toUpperCase": lambda this: check_length(values.to_units(values.from_units(this).upper())),
    "toLowerCase": lambda this: check_length(values.to_units(values.from_units(this).lower())),
    "trim": lambda this: this.strip(values.WHITESPACE),
    "repeat": _repeat,
    "padStart": lambda this, width, pad: check_length(_pad(this, width, pad) + this),
    "padEnd": lambda this, width, pad: check_length(this + _pad(this, width, pad)),
}


def _read_digits(value: Value, low: int) -> int | None:
    """How many digits are asked for, if any number is."""
    if value is UNDEFINED:
        return None
    digits = to_index(value)
    if not low <= digits <= 100:
        raise RunError(f"the number of digits must be from {low} to 100")
    return digits


NUMBER: Methods = {
    "toFixed": lambda this, places: to_fixed(this, _read_digits(places, 0) or 0),
    "toExponential": lambda this, places: to_exponential(
        this, _read_digits(places, 0) if math.isfinite(this) else None
    ),
    "toPrecision": lambda this, count: to_precision(this, _read_digits(count, 1) if math.isfinite(this) else None),
}
OF_TYPE: dict[type, Methods] = {
    kind: {name: make_lenient(method) for name, method in {**methods, "toString": to_string}.items()}
    for kind, methods in {float: NUMBER, bool: {}, str: TEXT, list: ARRAY, Vector: TYPED_ARRAY}.items()
}
CALLBACKS = {name: find_callback(method) for methods in OF_TYPE.values() for name, method in methods.items()}
"""Every method, with which of its arguments is a function, if one is."""


def call_method(m: Machine, this: Value, name: str, args: list[Any]) -> Value:
    """`this.name(...args)`. Raises RunError where the value has no such method."""
    method = OF_TYPE.get(type(this), {}).get(name)
    if method is None:
        what = to_string(this) if this is None or this is UNDEFINED else f"this {values.type_name(this)}"
        raise RunError(f"{what} has no method {name}")
    m.tick(1 + values.measure_weight(this) + (len(list_items(this)) if name == "sort" else 0))
    return method(this, *args)
