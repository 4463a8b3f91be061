"""What kinds whose answers have several parts share: fields of forms, ids and an order that tell nothing, and where
texts stand in a later version of a question."""

import json
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from itertools import chain, product
from string import ascii_lowercase
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from grader.errors import InvalidAnswer
from grader.questions.kind import FIELD, Fields
from grader.questions.question import distinct_texts

PARTS_MAX = 100
"""The most parts of a question."""

IDS = tuple(map("".join, chain.from_iterable(product(ascii_lowercase, repeat=length) for length in (1, 2))))
"""`a` to `z`, then `aa`, `ab`, ...: more than any question has parts."""


def by_id(texts: Iterable[str]) -> dict[str, str]:
    """Returns the distinct texts by the ids that learners see, `a`, `b`, ..., in the order of their SHA-256. Neither
    the ids nor the order depend on the order of `texts`, so that they tell nothing of the key."""
    return dict(zip(IDS, sorted(set(texts), key=_digest), strict=False))


def _digest(text: str) -> bytes:
    return sha256(text.encode(errors="surrogatepass")).digest()


PartText = Annotated[str, Field(min_length=1)]
"""The text of a part, as HTML."""

DistinctTexts = Annotated[tuple[PartText, ...], Field(max_length=PARTS_MAX), AfterValidator(distinct_texts)]
"""Texts of parts, no two of them equal."""


def field_of(part: str) -> str:
    """Returns the name of the field of a form that belongs to a part of the answer."""
    return f"{FIELD}.{part}"


def typed_for(fields: Fields, part: str) -> str:
    """Returns what was typed or chosen for a part; empty where nothing was."""
    return next(iter(fields.get(field_of(part), ())), "").strip()


def json_or_text(text: str) -> Any:
    """Returns the JSON value that a person typed; the text itself where it is no JSON, which `read` then refuses."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def follow_texts(earlier: Sequence[str], now: Sequence[str]) -> dict[int, int]:
    """Returns where each of `earlier` texts stands `now`: where its words are. Of reworded texts one alone is known,
    and those that all kept their places."""
    places = {" ".join(text.split()): at for at, text in enumerate(now)}
    words = [" ".join(text.split()) for text in earlier]
    moved = {at: places[text] for at, text in enumerate(words) if text in places}
    gone = [at for at in range(len(earlier)) if at not in moved]
    new = [at for at in range(len(now)) if at not in {*moved.values()}]
    if gone == new or len(gone) == len(new) == 1:
        moved |= dict(zip(gone, new, strict=True))
    return moved


def find_place(moved: Mapping[int, int], at: int) -> int:
    """Returns where a text stands now, of `follow_texts`. Raises InvalidAnswer where it is gone."""
    if at not in moved:
        raise InvalidAnswer("What was chosen is not in the question any more.")
    return moved[at]
