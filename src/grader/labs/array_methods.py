"""The methods of arrays and typed arrays."""

import functools
import math
from collections.abc import Callable

from grader.labs.machine import Machine
from grader.labs.operators import strictly_equal
from grader.labs.text_methods import clamped_span
from grader.labs.values import (
    UNDEFINED,
    Trouble,
    Value,
    Vector,
    bounded_list,
    join,
    to_boolean,
    to_index,
    to_number,
    to_string,
)

Callback = Callable[..., Value]
Items = list[Value]


def _items(this: Value) -> Items:
    return this.values() if isinstance(this, Vector) else this if isinstance(this, list) else []


def _like(this: Value, items: Items) -> Value:
    """A typed array makes typed arrays, an array makes arrays."""
    return this.like(items) if isinstance(this, Vector) else bounded_list(items)


def _map(m: Machine, this: Value, f: Callback) -> Value:
    return _like(this, [f(x, float(i), this) for i, x in enumerate(list(_items(this)))])


def _filter(m: Machine, this: Value, f: Callback) -> Value:
    return _like(this, [x for i, x in enumerate(list(_items(this))) if to_boolean(f(x, float(i), this))])


def _for_each(m: Machine, this: Value, f: Callback) -> Value:
    for i, x in enumerate(list(_items(this))):
        f(x, float(i), this)
    return UNDEFINED


def _reduce(m: Machine, this: Value, f: Callback, *initial: Value) -> Value:
    items = list(_items(this))
    if not items and not initial:
        raise Trouble("reduce of an empty array needs an initial value")
    start = 0 if initial else 1
    total = initial[0] if initial else items[0]
    for i in range(start, len(items)):
        total = f(total, items[i], float(i), this)
    return total


def _some(m: Machine, this: Value, f: Callback) -> Value:
    return any(to_boolean(f(x, float(i), this)) for i, x in enumerate(list(_items(this))))


def _every(m: Machine, this: Value, f: Callback) -> Value:
    return all(to_boolean(f(x, float(i), this)) for i, x in enumerate(list(_items(this))))


def _find_index(m: Machine, this: Value, f: Callback) -> Value:
    return next((float(i) for i, x in enumerate(list(_items(this))) if to_boolean(f(x, float(i), this))), -1.0)


def _find(m: Machine, this: Value, f: Callback) -> Value:
    items = list(_items(this))
    return next((x for i, x in enumerate(items) if to_boolean(f(x, float(i), this))), UNDEFINED)


def _by(f: Callback) -> Callable[[Value, Value], int]:
    def order(a: Value, b: Value) -> int:
        sign = to_number(f(a, b))
        return (sign > 0) - (sign < 0)

    return order


def _numeric_order(x: Value) -> tuple[bool, float, float]:
    """-0 before 0, NaN last."""
    number = to_number(x)
    return math.isnan(number), number, math.copysign(1.0, number)


def _sort(m: Machine, this: Value, f: Callback | None = None) -> Value:
    """In place; without a comparison arrays sort as text and typed arrays as numbers; undefined stands last."""
    items = _items(this)
    m.tick(len(items))
    defined = [x for x in items if x is not UNDEFINED]
    if f is not None:
        defined.sort(key=functools.cmp_to_key(_by(f)))
    elif isinstance(this, Vector):
        defined.sort(key=_numeric_order)
    else:
        defined.sort(key=to_string)
    return _store(this, defined + [UNDEFINED] * (len(items) - len(defined)))


def _store(this: Value, items: Items) -> Value:
    if isinstance(this, Vector):
        for i, x in enumerate(items):
            this.write(i, x)
    elif isinstance(this, list):
        this[:] = items
    return this


def _reverse(m: Machine, this: Value) -> Value:
    return _store(this, _items(this)[::-1])


def _fill(m: Machine, this: Value, value: Value = UNDEFINED, *span: Value) -> Value:
    start, end = clamped_span(len(_items(this)), span)
    m.tick((end - start) // 64)
    for i in range(start, end):
        if isinstance(this, Vector):
            this.write(i, value)
        elif isinstance(this, list):
            this[i] = value
    return this


def _slice(m: Machine, this: Value, *span: Value) -> Value:
    items = _items(this)
    start, end = clamped_span(len(items), span)
    return _like(this, items[start:end])


def _index_of(m: Machine, this: Value, wanted: Value = UNDEFINED, start: Value = UNDEFINED) -> Value:
    items = _items(this)
    first, _ = clamped_span(len(items), (start,))
    return next((float(i) for i in range(first, len(items)) if strictly_equal(items[i], wanted)), -1.0)


def _includes(m: Machine, this: Value, wanted: Value = UNDEFINED, start: Value = UNDEFINED) -> Value:
    first, _ = clamped_span(len(_items(this)), (start,))
    nan = isinstance(wanted, float) and math.isnan(wanted)
    return any(
        strictly_equal(x, wanted) or (nan and isinstance(x, float) and math.isnan(x)) for x in _items(this)[first:]
    )


def _at(m: Machine, this: Value, index: Value = UNDEFINED) -> Value:
    items = _items(this)
    k = to_index(index)
    k += len(items) if k < 0 else 0
    return items[k] if 0 <= k < len(items) else UNDEFINED


def _join(m: Machine, this: Value, separator: Value = UNDEFINED) -> Value:
    m.tick(len(_items(this)) // 64)
    return join(_items(this), "," if separator is UNDEFINED else to_string(separator), 0)


def _concat(m: Machine, this: Value, *others: Value) -> Value:
    joined: Items = list(_items(this))
    for other in others:
        joined.extend(other if isinstance(other, list) else [other])
        bounded_list(joined)
    return joined


def _push(m: Machine, this: Value, *values: Value) -> Value:
    assert isinstance(this, list)
    this.extend(values)
    return float(len(bounded_list(this)))


def _unshift(m: Machine, this: Value, *values: Value) -> Value:
    assert isinstance(this, list)
    this[0:0] = values
    return float(len(bounded_list(this)))


def _pop(m: Machine, this: Value) -> Value:
    assert isinstance(this, list)
    return this.pop() if this else UNDEFINED


def _shift(m: Machine, this: Value) -> Value:
    assert isinstance(this, list)
    return this.pop(0) if this else UNDEFINED


def _set(m: Machine, this: Value, source: Value = UNDEFINED, offset: Value = 0.0) -> Value:
    assert isinstance(this, Vector)
    if not isinstance(source, list | Vector):
        raise Trouble("set() copies an array")
    items, start = list(_items(source)), to_index(offset)
    if start < 0 or start + len(items) > this.array.size:
        raise Trouble(f"{len(items)} elements from {start} do not fit into {this.name}, which has {this.array.size}")
    for i, x in enumerate(items):
        this.write(start + i, x)
    return UNDEFINED


def _subarray(m: Machine, this: Value, *span: Value) -> Value:
    assert isinstance(this, Vector)
    start, end = clamped_span(this.array.size, span)
    return Vector(this.array[start : max(start, end)], this.name, this.writable)


SHARED: dict[str, Callable[..., Value]] = {
    "map": _map,
    "filter": _filter,
    "forEach": _for_each,
    "reduce": _reduce,
    "some": _some,
    "every": _every,
    "find": _find,
    "findIndex": _find_index,
    "sort": _sort,
    "reverse": _reverse,
    "fill": _fill,
    "slice": _slice,
    "indexOf": _index_of,
    "includes": _includes,
    "at": _at,
    "join": _join,
}
ARRAY = {**SHARED, "concat": _concat, "push": _push, "pop": _pop, "shift": _shift, "unshift": _unshift}
TYPED_ARRAY = {**SHARED, "set": _set, "subarray": _subarray}
CALLBACK_METHODS = frozenset(["map", "filter", "forEach", "reduce", "some", "every", "find", "findIndex", "sort"])
