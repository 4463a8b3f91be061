"""Questions with drawn numbers: the author writes `{kp}`, and every learner has a number of their own in its place.

A question that is loaded holds the numbers in the middle of their ranges, so that everything that knows questions knows
it; `with_numbers` makes the question of a learner.
"""

import json
import random
import re
from collections.abc import Iterator, Mapping
from math import floor, log10
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, Field, PrivateAttr, model_validator
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import PydanticCustomError

from grader.domain.numbers import Real

DRAWS_MAX = 6
TEMPLATE_MAX = 1 << 20
DIGITS = 3
"""Significant digits of a drawn number: a learner reads and types it."""

PROSE = ("q", "options", "explain", "whys", "label", "title", "note", "ylabel", "unit")
"""Keys of texts for people. Between dollars a number stays in its braces, which TeX takes for a group."""

NUMBERS = (
    "value", "min", "max", "seconds", "since", "until", "level", "band", "timestep", "tol", "at_least", "at_most",
    "low_s", "high_s",
)  # fmt: skip
"""Keys of numbers, where a placeholder alone is one."""

NAME = r"[A-Za-z_][A-Za-z0-9_]*"
PLACEHOLDER = re.compile(rf"\{{({NAME})\}}")

CODE = re.compile(r"<(code|pre)\b.*?</\1>", re.DOTALL | re.IGNORECASE)

Numbers = Mapping[str, float]


def _check_ranges(ranges: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    for name, (low, high) in ranges.items():
        if low >= high:
            why = {"why": f"{name} goes from a low to a high end, and {low:g} is not below {high:g}"}
            raise PydanticCustomError("draw", "{why}", why)
    return ranges


class Drawable(BaseModel):
    """A question with drawn numbers: `draw` holds the range of each by name. Its key is that of the numbers in the
    middle; each learner's own is derived by `verify`. `template` is the author's JSON, with the names; `fill_in_middle`
    writes it before a question is validated."""

    draw: Annotated[
        dict[Annotated[str, Field(pattern=f"^{NAME}$", max_length=32)], tuple[Real, Real]],
        Field(max_length=DRAWS_MAX), AfterValidator(_check_ranges),
    ] = Field(default_factory=dict)  # fmt: skip
    template: SkipJsonSchema[str] = Field(default="", repr=False, max_length=TEMPLATE_MAX)
    _is_posed: bool = PrivateAttr(default=False)

    @model_validator(mode="after")
    def _shows_every_number(self) -> Self:
        shown = list_names(str(json.loads(self.template).get("q"))) if self.template else set()
        if self.template and (hidden := [name for name in self.draw if name not in shown]):
            why = {"name": f"{{{hidden[0]}}}"}
            raise PydanticCustomError("draw", "q never shows {name}: write it there, so that learners see it", why)
        return self

    def with_numbers(self, numbers: Numbers, answers: Mapping[str, float] | None = None) -> Self:
        """Returns the question with these numbers in the places of their names; `answers` replace its keys, by their
        place (`AnswerKey.place`). The question itself where nothing is drawn."""
        if not self.template:
            return self
        raw = {name: value for name, value in fill_in(json.loads(self.template), numbers).items() if name != "draw"}
        for place, answer in (answers or {}).items():
            at = raw
            for step in filter(None, place.split(".")):
                at = at[int(step)] if step.isdigit() else at[step]
            at["answer"] = answer
        posed = self.model_validate_json(json.dumps(raw), strict=True)
        posed._is_posed = True
        return posed

    @property
    def is_posed(self) -> bool:
        """Whether it has the numbers of a learner."""
        return self._is_posed


def get_draw(question: BaseModel) -> Any:
    """Returns what is drawn for each learner in a question; nothing where all have the same numbers."""
    return question.draw if isinstance(question, Drawable) else {}


def is_drawn(question: BaseModel) -> bool:
    """Whether every learner has numbers of their own in a question."""
    return bool(get_draw(question))


def fill_in_middle(raw: Any) -> Any:
    """Returns the JSON of a question, or of a quiz, with the middle of each range in the places of its name. Whatever
    is wrong with `draw` is left for the question's model to tell."""
    if not isinstance(raw, Mapping):
        return raw
    if isinstance(raw.get("questions"), list):
        return {**raw, "questions": [fill_in_middle(question) for question in raw["questions"]]}
    ranges = raw.get("draw")
    try:
        middle = find_middle(ranges) if isinstance(ranges, Mapping) and ranges else {}
    except (TypeError, ValueError, OverflowError):
        return raw
    return fill_in(raw, middle) | {"template": json.dumps(raw)} if middle else raw


def list_unknown_names(question: BaseModel) -> Iterator[tuple[str, str]]:
    """Yields the names in braces that `draw` does not have, each with the key of its text: learners would read them as
    they stand. Formulas and code have braces of their own."""
    if not isinstance(question, Drawable) or not question.draw:
        return
    raw = json.loads(question.template)
    for key in ("q", "options", "whys", "explain"):
        texts = raw.get(key) or ()
        for text in (texts,) if isinstance(texts, str) else texts:
            plain = CODE.sub("", " ".join(str(text).split("$")[::2]))
            yield from ((key, name) for name in PLACEHOLDER.findall(plain) if name not in question.draw)


def round_short(value: float) -> float:
    """Returns a number with DIGITS significant digits; a whole one as such."""
    short = round(value, DIGITS - 1 - floor(log10(abs(value)))) if value else 0.0
    return int(short) if short == int(short) and abs(short) < 1e9 else short


def find_middle(ranges: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Returns the middle of each range."""
    return {name: round_short((low + high) / 2) for name, (low, high) in ranges.items()}


def list_corners(ranges: Mapping[str, tuple[float, float]]) -> Iterator[dict[str, float]]:
    """Yields the numbers at the ends of their ranges: all low, all high, and each one alone at its other end."""
    names = list(ranges)
    yield {name: ranges[name][0] for name in names}
    yield {name: ranges[name][1] for name in names}
    if len(names) > 1:
        for odd in names:
            yield {name: ranges[name][int(name != odd)] for name in names}


def draw_numbers(ranges: Mapping[str, tuple[float, float]], seed: int) -> dict[str, float]:
    """Returns numbers, uniform in their ranges, the same for the same seed on every machine. Source: Python keeps
    `random.random` the same for a seed in all versions."""
    chance = random.Random(seed)
    drawn = {name: round_short(low + (high - low) * chance.random()) for name, (low, high) in ranges.items()}
    return {name: min(max(value, ranges[name][0]), ranges[name][1]) for name, value in drawn.items()}


def fill_in(raw: Any, numbers: Numbers, key: str = "") -> Any:
    """Returns JSON with numbers in the places of their names. In an expression a number stands in brackets."""
    if isinstance(raw, Mapping):
        return {name: fill_in(value, numbers, name) if name != "draw" else value for name, value in raw.items()}
    if isinstance(raw, list | tuple):
        return [fill_in(value, numbers, key) for value in raw]
    if not isinstance(raw, str) or "{" not in raw:
        return raw
    if key in PROSE:
        parts = raw.split("$")
        return "$".join(write(part, numbers, "{{{}}}" if index % 2 else "{}") for index, part in enumerate(parts))
    whole = PLACEHOLDER.fullmatch(raw.strip()) if key in NUMBERS else None
    if whole and whole[1] in numbers:
        return numbers[whole[1]]
    return write(raw, numbers, "{}" if key == "xml" else "({})")


def list_names(text: str) -> set[str]:
    """Returns the names in braces."""
    return set(PLACEHOLDER.findall(text))


def write(text: str, numbers: Numbers, form: str) -> str:
    """Returns a text with numbers in the places of their names, each in the form."""
    return PLACEHOLDER.sub(
        lambda match: form.format(f"{numbers[match[1]]:g}") if match[1] in numbers else match[0], text
    )
