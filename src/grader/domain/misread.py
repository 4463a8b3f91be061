"""Authors' JSON before and after pydantic: removes remarks, and explains what was refused, where, and the cure."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

NO_MOMENT = "must be a date and time with its offset, such as 2026-10-19T18:00+02:00"

KnownKeys = Callable[[Sequence[str]], Iterable[str]]
"""Returns the keys that are allowed beside a key, by the names in pydantic's location of it."""


def drop_remarks(value: Any) -> Any:
    """Returns a JSON value without the keys that begin with `x-`, at any depth."""
    if isinstance(value, Mapping):
        return {name: drop_remarks(item) for name, item in value.items() if not name.startswith("x-")}
    return [drop_remarks(item) for item in value] if isinstance(value, list | tuple) else value


def explain_misread(
    error: ValidationError, raw: Any, known_keys: KnownKeys, choices: Mapping[str, str] = {}
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Yields the place of every refused value in the JSON value `raw`, and one reason for each place. `choices`: the
    values of each key that selects the class of a part. Leaves out what only follows from a fault inside a part."""
    details = error.errors(include_url=False)
    reported = set[tuple[str | int, ...]]()
    for detail in details:
        loc = detail["loc"]
        if detail["type"] == "default_factory_not_called":
            continue
        if detail["type"] == "too_short" and any(loc == other["loc"][: len(loc)] != other["loc"] for other in details):
            continue
        place = tuple(locate(raw, detail))
        if place not in reported:
            reported.add(place)
            yield place, explain_reason(detail, known_keys, choices)


def locate(raw: Any, detail: ErrorDetails) -> Iterator[str | int]:
    """Yields the steps of pydantic's location that are keys or indices of the JSON, not names of classes."""
    loc = detail["loc"]
    for step in loc:
        inside = raw if isinstance(raw, Mapping) else range(len(raw)) if isinstance(raw, list | tuple) else ()
        is_there = step in inside
        if is_there:
            raw = raw[step]
        if is_there or (detail["type"] == "missing" and step == loc[-1]):
            yield step
    if detail["type"].startswith("union_tag") and isinstance(raw, Mapping):
        yield "type" if "controls" in loc else detail["ctx"]["discriminator"].strip("'")


def explain_reason(detail: ErrorDetails, known_keys: KnownKeys, choices: Mapping[str, str]) -> str:
    """Returns what is wrong with a value, and how to correct it."""
    match detail["type"]:
        case "missing":
            return "is missing: add it"
        case "extra_forbidden":
            steps = [step for step in detail["loc"] if isinstance(step, str)]
            near = find_nearest(steps[-1], list(known_keys(steps)))
            return f"unknown key: {f'write {near!r}, or ' if near else ''}remove it, or begin it with x-"
        case "union_tag_not_found":
            name = detail["ctx"]["discriminator"].strip("'")
            near = next(iter(get_close_matches(name, map(str, detail["input"]), n=1, cutoff=0.7)), None)
            return f"is missing: {f'rename {near!r}' if near else 'add it'} ({choices.get(name, '')})"
        case "union_tag_invalid":
            return f"there is no {detail['ctx']['tag']!r}: one of {detail['ctx']['expected_tags']}"
        case "option_index":
            return detail["msg"]
    why = NO_MOMENT if detail["type"].startswith(("timezone_aware", "datetime")) else detail["msg"]
    why = re.sub(r"^(Input|String|Tuple|List|Dictionary) should", "must", why).removeprefix("Value error, ")
    why = why.replace("a valid array", "a list between [ and ]").replace(" after validation", "")
    given = detail["input"]
    return f"{why}, not {given!r}"[:300] if isinstance(given, int | float | str | None) else why


def find_nearest(name: str, known: Sequence[str]) -> str | None:
    """Returns the known key that an unknown one is most likely a misspelling of."""
    near = get_close_matches(name, known, n=1)
    return next(
        iter(near or [candidate for candidate in known if len(candidate) > 2 and name.startswith(candidate)]), None
    )
