"""Front matter: the keys of a quiz as YAML, of which only what JSON has too is read: no dates, no sexagesimal numbers,
no `yes`, no anchors."""

import json
import re
from collections.abc import Hashable
from typing import Any

import yaml

from grader.errors import Fault

MARK = "---"
CHARS_MAX = 64 << 10

UNPRINTABLE = re.compile("[\x7f-\x9f\u2028\u2029\ufeff]")
"""Characters that YAML takes for the end of a line, or not at all."""

SCALARS = (
    ("tag:yaml.org,2002:bool", re.compile(r"^(?:true|false)$"), "tf"),
    ("tag:yaml.org,2002:null", re.compile(r"^(?:null|~|)$"), ["n", "~", ""]),
    ("tag:yaml.org,2002:int", re.compile(r"^-?(?:0|[1-9][0-9]*)$"), "-0123456789"),
    ("tag:yaml.org,2002:float", re.compile(r"^-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?$"), "-0123456789"),
)


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """Reads YAML with JSON's scalars. Raises yaml.YAMLError for an alias and for a key that is there twice."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012 - yaml's own way

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.MarkedYAMLError(None, None, "aliases are not read: write it out", self.peek_event().start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        seen = set[str]()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.MarkedYAMLError(None, None, "a key must be one word", key.start_mark)
            if key.value in seen:
                raise yaml.MarkedYAMLError(None, None, f"{key.value} occurs more than once: keep one", key.start_mark)
            seen.add(key.value)
        mapping: dict[Hashable, Any] = super().construct_mapping(node, deep=deep)
        return mapping


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]
    """Writes a text in quotes where this loader, or another one of YAML, would take it for a number or the like."""


for _tag, _pattern, _first in SCALARS:
    _Loader.add_implicit_resolver(_tag, _pattern, list(_first))
    _Dumper.add_implicit_resolver(_tag, _pattern, list(_first))


def split_front_matter(text: str) -> tuple[str, str]:
    """Returns the front matter without its marks, and the text with an empty line for each of its lines."""
    lines = text.split("\n")
    if lines[0].rstrip() != MARK:
        return "", text
    end = next((at for at, line in enumerate(lines[1:], 1) if line.rstrip() == MARK), 0)
    return ("\n".join(lines[1:end]), "\n" * (end + 1) + "\n".join(lines[end + 1 :])) if end else ("", text)


def read_front_matter(front: str, file: str) -> dict[str, Any] | Fault:
    """Returns the keys of a quiz, or what is wrong with them, with the line."""
    if len(front) > CHARS_MAX:
        return Fault(file, "line 1", f"the front matter is longer than {CHARS_MAX >> 10} KB: make it shorter")
    try:
        data = yaml.load(front, _Loader)  # noqa: S506 - derived of SafeLoader
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 2 if mark else 1
        return Fault(file, f"line {line}", f"front matter: {error.problem or error.context}")
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        return Fault(file, "line 1", f"front matter: {' '.join(str(error).split())[:200] or 'nested too deeply'}")
    if data is None:
        return {}
    if not isinstance(data, dict) or not all(isinstance(name, str) for name in data):
        return Fault(file, "line 1", "front matter: must be keys with values, such as title: Knowledge check")
    return data


def write_front_matter(values: dict[str, Any]) -> str:
    """Returns the front matter with its marks: YAML, or JSON where that does not read back; YAML reads it too. Raises
    ValueError for what neither can hold."""
    try:
        plain = yaml.dump(values, Dumper=_Dumper, allow_unicode=True, sort_keys=False, width=10_000)
    except (yaml.YAMLError, RecursionError):
        plain = ""
    line = json.dumps(values, ensure_ascii=False, allow_nan=False)
    as_json = UNPRINTABLE.sub(lambda match: f"\\u{ord(match[0]):04x}", line) + "\n"
    for text in (plain, as_json):
        if MARK not in text.splitlines() and read_front_matter(text, "") == values:
            return f"{MARK}\n{text}{MARK}\n"
    raise ValueError("the keys of this quiz cannot be written as front matter")
