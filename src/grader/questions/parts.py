"""What kinds whose answers have several parts share: fields of forms, and ids and an order that tell nothing."""

import json
from collections.abc import Iterable
from hashlib import sha256
from itertools import chain, product
from string import ascii_lowercase
from typing import Annotated, Any

from pydantic import AfterValidator, Field

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
