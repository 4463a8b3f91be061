"""Which methods a value has. Everything else, prototypes included, does not exist."""

import inspect
from collections.abc import Callable
from typing import Any

from grader.labs import array_methods, number_text, text_methods
from grader.labs.machine import Machine
from grader.labs.values import Trouble, Undefined, Value, Vector, to_string, type_name, weight


def _to_string(m: Machine, this: Value) -> Value:
    return to_string(this)


TO_STRING: dict[str, Callable[..., Value]] = {"toString": _to_string}
OF_TYPE: dict[type, dict[str, Any]] = {
    float: {**number_text.METHODS, **TO_STRING},
    bool: TO_STRING,
    str: {**text_methods.METHODS, **TO_STRING},
    list: {**array_methods.ARRAY, **TO_STRING},
    Vector: {**array_methods.TYPED_ARRAY, **TO_STRING},
}
NAMES = frozenset(name for methods in OF_TYPE.values() for name in methods)
CALLBACK_METHODS = array_methods.CALLBACK_METHODS


MOST_ARGUMENTS = {
    method: None if method.__code__.co_flags & inspect.CO_VARARGS else method.__code__.co_argcount - 2
    for methods in OF_TYPE.values()
    for method in methods.values()
}
"""After the machine and the value itself; None for any number. JavaScript ignores what is too much."""


def call_method(m: Machine, this: Value, name: str, args: list[Any]) -> Value:
    """`this.name(...args)`. Raises Trouble where the value has no such method."""
    method = OF_TYPE.get(type(this), {}).get(name)
    if method is None:
        what = to_string(this) if this is None or isinstance(this, Undefined) else f"this {type_name(this)}"
        raise Trouble(f"{what} has no method {name}")
    m.tick(1 + weight(this))
    result: Value = method(m, this, *args[: MOST_ARGUMENTS[method]])
    return result
