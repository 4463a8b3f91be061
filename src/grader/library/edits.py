"""What differs between two versions of an author's JSON: where, the old and the new, as an author reads them."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import SequenceMatcher
from itertools import zip_longest
from typing import Any, NamedTuple

NOTHING = "nothing"
"""Is shown for a missing value."""
AROUND = 6
"""Words of a long text that are shown before and after those that differ."""
SHORT = 80
"""Texts of so many characters are shown whole."""
LENGTH_MAX = 400
"""Characters of a value that are shown."""


class Edit(NamedTuple):
    """A value that differs: the author's keys that lead to it, such as `check › cases › heavy › mass`, the old and the
    new. Of long texts only the part that differs is shown. Where `old` is empty, `new` is a sentence on the value."""

    path: str
    old: str
    new: str


def list_edits(old: Any, new: Any, path: str = "") -> Iterator[Edit]:
    """Yields every value of nested JSON that differs."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for name in {**old, **new}:
            yield from list_edits(old.get(name), new.get(name), join_path(path, name))
    elif isinstance(old, list | tuple) and isinstance(new, list | tuple):
        yield from _list_items(old, new, path)
    elif old != new:
        yield Edit(path, *shorten_pair(write_value(old), write_value(new)))


def join_path(path: str, name: str) -> str:
    """Returns the path of a key below another."""
    return f"{path} › {name}" if path else name


def _list_items(olds: Sequence[Any], news: Sequence[Any], path: str) -> Iterator[Edit]:
    """Yields what differs in two lists: of items with ids by id, else by place."""
    named, named_now = _name_items(olds), _name_items(news)
    if named is not None and named_now is not None:
        yield from list_edits(named, named_now, path)
        if named.keys() == named_now.keys() and [*named] != [*named_now]:
            yield Edit(join_path(path, "order"), ", ".join(named), ", ".join(named_now))
        return
    if is_reordered(olds, news):
        yield Edit(path, "", _describe_order(olds, news))
        return
    before, after = ([json.dumps(value) for value in some] for some in (olds, news))
    for tag, start, end, start_now, end_now in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if tag != "equal":
            pairs = zip_longest(olds[start:end], news[start_now:end_now])
            for place, (old, new) in enumerate(pairs, 1 + (start if tag == "delete" else start_now)):
                yield from list_edits(old, new, join_path(path, f"no. {place}"))


def is_reordered(olds: Any, news: Any) -> bool:
    """Whether two lists hold the same values in another order. Numbers are values at their places, such as those of a
    vector, and have no order of their own."""
    if not (isinstance(olds, list | tuple) and isinstance(news, list | tuple)) or olds == news:
        return False
    before, after = (sorted(map(json.dumps, some)) for some in (olds, news))
    return before == after and not any(isinstance(value, int | float) for value in olds)


def _describe_order(olds: Sequence[Any], news: Sequence[Any]) -> str:
    """Says at which places the values of a list were before, from the first to the last that has moved."""
    places: dict[str, list[int]] = {}
    for place, value in enumerate(olds, 1):
        places.setdefault(json.dumps(value), []).append(place)
    earlier = [places[json.dumps(value)].pop(0) for value in news]
    moved = [place for place, before in enumerate(earlier, 1) if place != before]
    first, last = moved[0], moved[-1]
    was = ", ".join(map(str, earlier[first - 1 : last]))
    return f"the order has changed, the entries are the same: no. {first} to {last} were no. {was} before"


def _name_items(items: Sequence[Any]) -> dict[str, Any] | None:
    """Returns the items of a list by their ids; None where one has none, or shares it."""
    named = {item["id"]: item for item in items if isinstance(item, Mapping) and isinstance(item.get("id"), str)}
    return named if len(named) == len(items) > 0 else None


def write_value(value: Any) -> str:
    """Writes a value as its author does; a text without its quotation marks."""
    if value is None:
        return NOTHING
    if isinstance(value, float):
        return f"{value:.12g}"
    return value if isinstance(value, str) and value else json.dumps(value, ensure_ascii=False)


def shorten_pair(old: str, new: str) -> tuple[str, str]:
    """Returns two texts, each cut to the words that differ and some around them where one of them is long."""
    olds, news = re.findall(r"\S+\s*", old), re.findall(r"\S+\s*", new)
    head = tail = 0
    if max(len(old), len(new)) > SHORT:
        least = min(len(olds), len(news))
        head = next((n for n in range(least) if olds[n] != news[n]), least)
        tail = next((n for n in range(least - head) if olds[-1 - n] != news[-1 - n]), least - head)
    skip, drop = max(head - AROUND, 0), max(tail - AROUND, 0)
    return _cut(olds, skip, drop) or NOTHING, _cut(news, skip, drop) or NOTHING


def _cut(words: Sequence[str], skip: int, drop: int) -> str:
    """Returns words without the first `skip` and the last `drop`, with dots in their places."""
    text = "".join(words[skip : len(words) - drop]).strip()
    is_long = len(text) > LENGTH_MAX
    return ("… " if skip else "") + text[:LENGTH_MAX] + (" …" if drop or is_long else "")
