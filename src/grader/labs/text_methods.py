"""The methods of texts, counted in UTF-16 code units."""

from collections.abc import Callable

from grader.labs.machine import Machine
from grader.labs.values import (
    STRING_MAX,
    UNDEFINED,
    WHITESPACE,
    Trouble,
    Value,
    bounded,
    from_units,
    in_units,
    to_index,
    to_string,
)


def clamped_span(length: int, args: tuple[Value, ...]) -> tuple[int, int]:
    """Start and end from up to two arguments that may be missing or count from the back."""

    def clamp(k: int) -> int:
        return max(0, length + k) if k < 0 else min(k, length)

    start = clamp(to_index(args[0])) if args else 0
    end = clamp(to_index(args[1], length)) if len(args) > 1 else length
    return start, end


def _slice(m: Machine, this: str, *span: Value) -> Value:
    start, end = clamped_span(len(this), span)
    return this[start:end]


def _index_of(m: Machine, this: str, wanted: Value = UNDEFINED, start: Value = UNDEFINED) -> Value:
    return float(this.find(to_string(wanted), max(0, min(to_index(start), len(this)))))


def _includes(m: Machine, this: str, wanted: Value = UNDEFINED, start: Value = UNDEFINED) -> Value:
    return to_string(wanted) in this[max(0, to_index(start)) :]


def _starts_with(m: Machine, this: str, wanted: Value = UNDEFINED, start: Value = UNDEFINED) -> Value:
    return this[max(0, to_index(start)) :].startswith(to_string(wanted))


def _ends_with(m: Machine, this: str, wanted: Value = UNDEFINED, end: Value = UNDEFINED) -> Value:
    return this[: max(0, to_index(end, len(this)))].endswith(to_string(wanted))


def _at(m: Machine, this: str, index: Value = UNDEFINED) -> Value:
    k = to_index(index)
    k += len(this) if k < 0 else 0
    return this[k] if 0 <= k < len(this) else UNDEFINED


def _char_at(m: Machine, this: str, index: Value = UNDEFINED) -> Value:
    k = to_index(index)
    return this[k] if 0 <= k < len(this) else ""


def _concat(m: Machine, this: str, *others: Value) -> Value:
    return bounded(this + "".join(map(to_string, others)))


def _upper(m: Machine, this: str) -> Value:
    return bounded(in_units(from_units(this).upper()))


def _lower(m: Machine, this: str) -> Value:
    return bounded(in_units(from_units(this).lower()))


def _trim(m: Machine, this: str) -> Value:
    return this.strip(WHITESPACE)


def _repeat(m: Machine, this: str, count: Value = UNDEFINED) -> Value:
    times = to_index(count)
    if times < 0:
        raise Trouble("a text cannot be repeated a negative number of times")
    return bounded(this * min(times, STRING_MAX + 1))


def _padding(this: str, width: Value, pad: Value) -> str:
    filler = " " if pad is UNDEFINED else to_string(pad)
    missing = min(to_index(width), STRING_MAX + 1) - len(this)
    if missing <= 0 or not filler:
        return ""
    return (filler * (missing // len(filler) + 1))[:missing]


def _pad_start(m: Machine, this: str, width: Value = UNDEFINED, pad: Value = UNDEFINED) -> Value:
    return bounded(_padding(this, width, pad) + this)


def _pad_end(m: Machine, this: str, width: Value = UNDEFINED, pad: Value = UNDEFINED) -> Value:
    return bounded(this + _padding(this, width, pad))


METHODS: dict[str, Callable[..., Value]] = {
    "slice": _slice,
    "indexOf": _index_of,
    "includes": _includes,
    "startsWith": _starts_with,
    "endsWith": _ends_with,
    "at": _at,
    "charAt": _char_at,
    "concat": _concat,
    "toUpperCase": _upper,
    "toLowerCase": _lower,
    "trim": _trim,
    "repeat": _repeat,
    "padStart": _pad_start,
    "padEnd": _pad_end,
}
