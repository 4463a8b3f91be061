"""Parses JSON strictly: repeated keys and NaN are faults; keys that begin with `x-` are remarks."""

import json
import math
import re
from collections.abc import Iterable, Iterator
from typing import Any

from grader.errors import Fault

DEPTH_MAX = 50
"""Deepest nesting of lists and objects."""


SURROGATE = re.compile("[\ud800-\udfff]")

OTHER_HALF = {"{": "}", "[": "]"}

TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"?|[{}\[\]]', re.DOTALL)
"""A text, also one that does not end, or a bracket."""

CURLY = ("\u201c", "\u201d", "\u201e", "\u2018", "\u2019")

CURLY_END = re.compile(f'[{"".join(CURLY)}]\\s*(?:[,:}}\\]][^"A-Za-z]*"?)?$')
"""The end of a text that goes on behind the curly quote that was to end it: no straight one stands right after it."""


class JsonObject(dict[str, Any]):
    """A JSON object; `repeated` lists the keys that occur more than once."""

    def __init__(self, pairs: list[tuple[str, Any]]) -> None:
        super().__init__(pairs)
        names = [name for name, _ in pairs]
        self.repeated = sorted({name for name in names if names.count(name) > 1}) if len(names) > len(self) else []


def parse_json(text: str, file: str) -> Any | Fault:
    """Parse a text; a fault gives line and column."""
    try:
        value = json.loads(text, object_pairs_hook=JsonObject)
    except json.JSONDecodeError as error:
        position = _find_last_comma(text, error.pos)
        if position is None:
            return _fault_at(text, error.pos, file, f"{error.msg}{_cure(text, error.pos)}")
        return _fault_at(text, position, file, "remove the comma after the last item")
    except (RecursionError, ValueError):
        return Fault(file, "whole file", "broken JSON: nested too deeply, or a number with too many digits")
    too_deep = measure_depth(value) > DEPTH_MAX
    return Fault(file, "whole file", f"nested deeper than {DEPTH_MAX} levels") if too_deep else value


def _fault_at(text: str, position: int, file: str, why: str) -> Fault:
    line, column = text.count("\n", 0, position) + 1, position - text.rfind("\n", 0, position)
    return Fault(file, f"line {line}, column {column}", f"broken JSON: {why}")


def _find_last_comma(text: str, position: int) -> int | None:
    """Returns the place of a comma before a closing bracket, where that is the error at this position: Python 3.13 is
    stopped by the comma, those before it by the bracket."""
    comma = position if text[position : position + 1] == "," else len(text[:position].rstrip()) - 1
    is_last = text[comma : comma + 1] == "," and text[comma + 1 :].lstrip()[:1] in ("]", "}")
    return comma if is_last else None


def _cure(text: str, position: int) -> str:
    """Returns the cure for what is JavaScript and not JSON at this position, for the quotes of a word processor and for
    a bracket without its other half; empty where there is no known one."""
    if text.startswith(("//", "/*", "#"), position):
        return " (JSON has no comments: take a key that begins with x-)"
    if text.startswith(("'", "`"), position):
        return ' (texts stand between double quotes: "...")'
    opened, last = _scan(text, position)
    if text.startswith(CURLY, position) or CURLY_END.search(last):
        return ' (write straight quotes: "...")'
    return _cure_bracket(opened, text, position)


def _scan(text: str, position: int) -> tuple[list[str], str]:
    """Returns the brackets that are open at a position, and the text that begins there, which has no end, else the last
    one before it."""
    opened: list[str] = []
    last = ""
    for token in TOKEN.findall(text, 0, position):
        if token in OTHER_HALF:
            opened.append(token)
        elif token.startswith('"'):
            last = token
        elif opened:
            opened.pop()
    return opened, text[position:] if text.startswith('"', position) else last


def _cure_bracket(opened: list[str], text: str, position: int) -> str:
    """Returns the cure for a bracket without its other half, by what is open at the position where it shows."""
    here = text[position:].lstrip()[:1]
    if not opened:
        return f" (this {here} is one too many: remove it)" if here in OTHER_HALF.values() else ""
    inner, half = opened[-1], OTHER_HALF[opened[-1]]
    if here == "" or (inner == here == "{" and text[:position].rstrip().endswith(",")):
        return f" (a {inner} has no {half}: add it)"
    if here in OTHER_HALF.values() and here != half:
        return f" (a {inner} has no {half}: add it, or this {here} is one too many)"
    return ""


def measure_depth(value: Any) -> int:
    """Returns the depth of nesting of lists and objects."""
    level, levels = [value], 0
    while level:
        level = [inner for item in level if isinstance(item, dict | list) for inner in _inside(item)]
        levels += 1
    return levels - 1


def _inside(item: dict[str, Any] | list[Any]) -> Iterable[Any]:
    return item.values() if isinstance(item, dict) else item


def json_faults(value: Any, file: str, key: str) -> Iterator[Fault]:
    """Faults for repeated keys, and for numbers and texts that JSON cannot represent, at any depth."""
    if isinstance(value, JsonObject):
        for name in value.repeated:
            yield Fault(file, join_key(key, name), "occurs more than once: keep one")
        for name, item in value.items():
            yield from json_faults(item, file, join_key(key, name))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from json_faults(item, file, join_key(key, index))
    elif isinstance(value, str) and SURROGATE.search(value):
        yield Fault(file, key, "holds half a surrogate pair, which is not a character: write the character itself")
    elif isinstance(value, float) and not math.isfinite(value):
        yield Fault(file, key, "must be a finite number: JSON has no NaN and no infinity")


def join_key(key: str, *parts: str | int) -> str:
    """Extend a key: `q3.sim`, "controls", 0 gives `q3.sim.controls.0`."""
    return ".".join([*([key] if key else []), *map(str, parts)])
