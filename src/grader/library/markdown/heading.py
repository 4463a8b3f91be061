"""The heading of a question: its title, and in braces its id, kind and short keys: `## A period {#period points=2}`."""

import json
import re
from collections.abc import Mapping
from typing import Any

BRACES = re.compile(r"\{([^{}]*)\}$")
NESTED = re.compile(r"(?:^|\s)\{[#.].*\}$")
"""Braces within those of a heading, such as a value of JSON."""
ATTRIBUTE = re.compile(r'\s*(?:#([\w.-]+)|\.([\w-]+)|([\w-]+)=("(?:[^"\\]|\\.)*"|[^\s"]+))(?=\s|$)')
PLAIN = re.compile(r"[A-Za-z][\w.-]*")

EXAMPLE = "{#period .numeric points=2}"


def read_heading(content: str) -> dict[str, Any]:
    """Returns the keys that a heading gives. Raises ValueError with what is wrong, and the cure."""
    match = BRACES.search(content)
    if match is None:
        if NESTED.search(content):
            raise ValueError(f"the braces are not read: write them like {EXAMPLE}, other keys in a fence ```question")
        return {"title": content} if content else {}
    values: dict[str, Any] = {}
    title, inside, at = content[: match.start()].rstrip(), match[1].strip(), 0
    if title:
        values["title"] = title
    while at < len(inside):
        part = ATTRIBUTE.match(inside, at)
        if part is None:
            raise ValueError(f"{inside[at:].strip()[:40]!r} in the braces is not read: write them like {EXAMPLE}")
        id_, kind, name, value = part.groups()
        name, read = ("id", id_) if id_ else ("kind", kind) if kind else (name, read_value(value))
        if name in values:
            raise ValueError(f"{name} is given twice: keep one")
        values[name] = read
        at = part.end()
    return values


def read_value(text: str) -> Any:
    """Returns a value of JSON, or the text itself where it is none."""
    try:
        return json.loads(text, parse_constant=str)
    except ValueError:
        return text


def write_heading(title: str, values: Mapping[str, Any]) -> str:
    """Returns the heading of a question with these short keys; texts stand in quotes."""
    parts = [f"#{values['id']}"] if "id" in values else []
    parts += [f".{values['kind']}"] if "kind" in values else []
    rest = {name: value for name, value in values.items() if name not in ("id", "kind")}
    parts += [f"{name}={json.dumps(value, ensure_ascii=False)}" for name, value in rest.items()]
    return " ".join(filter(None, ["##", title, f"{{{' '.join(parts)}}}" if parts else ""]))
