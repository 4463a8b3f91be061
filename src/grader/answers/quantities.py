"""Read a typed answer to a numeric question: a number, with or without a unit, in the unit of the question."""

import re
from dataclasses import dataclass
from typing import Any

from grader.answers.numbers import finite, format_number, not_one_number, read_number, unreadable
from grader.answers.spelling import fold, quoted, without_markup
from grader.answers.units import Unit, convert, known_unit, read_unit
from grader.errors import InvalidAnswer

CHARACTERS_MAX = 200
"""The longest text that is read; tags and TeX count."""

PROPORTIONS = {"percent", "permille", "ppm"}
"""Units that a question without a unit accepts."""

NO_UNIT = Unit("", ())

RELATION = re.compile(r"([=<>≤≥≈~:≠]+)")
EQUAL = frozenset("=≈~")
BELOW = frozenset({"<", "<=", "=<", "≤", ":", ":="})
NAME = re.compile(
    r"(?!(?:not|pi|π)\b)(?:(?:the|a|my|max|maximum|min|minimum|largest|smallest|time|step|Δ|d|delta) ){0,3}"
    r"[^\W\d]\w{0,15}(?: [0-9]|\^?\*|')?",
    re.IGNORECASE,
)
"""Names that may precede the sign in `h < 5 ms`; other words could change the meaning, as in `log h = 5`."""

IS = re.compile(r" (?:is|equals|ist) ", re.I)
"""Reads `h is 5 ms` as `h = 5 ms`."""

HEDGE = re.compile(
    r"(?:about|around|approximately|approx\.?|roughly|exactly|circa|ca\.?|etwa|ungefähr)(?: |(?<=\.)|(?=[0-9]))", re.I
)
WRAPPINGS = {"(": ")", "[": "]", '"': '"', "'": "'", "`": "`", "*": "*"}
WRAPPINGS_MAX = 4
FULL_STOPS = ".,;!? "
"""Punctuation that may follow a unit; after a bare number it could change the value: `5!` is 120."""

SET_OFF = re.compile(r"\[([^][]+)\]|-([A-Za-zμ].*)")
"""The unit of `5 [ms]` and `5-ms`."""

AGREEMENT = 1e-3
"""Relative difference up to which both sides of `1/3 = 0.3333` are the same answer."""


@dataclass(frozen=True)
class Quantity:
    """An answer as it was understood: `value` in the question's `unit`, from a `number` in the `typed_unit`."""

    value: float
    number: float
    typed_unit: Unit | None
    unit: str

    def __str__(self) -> str:
        """The answer in the question's unit, `5 ms`."""
        return f"{format_number(self.value)} {self.unit}".strip()


def read_quantity(answer: Any, unit: str | None) -> Quantity:
    """Read a JSON number or a text, and convert it to the question's unit, which is assumed where none is typed.

    Raises InvalidAnswer with one sentence: why the answer cannot be read, and what would be readable.
    """
    shown = without_markup(unit or "")
    try:
        if isinstance(answer, str):
            return _read_text(answer, shown)
        if isinstance(answer, int | float) and not isinstance(answer, bool):
            value = _as_float(answer)
            return Quantity(value, value, None, shown)
        raise InvalidAnswer("The answer must be a number, or a text: type one number.")
    except InvalidAnswer as error:
        where = f"in {shown}" if shown else "without a unit"
        raise InvalidAnswer(f"{str(error).removesuffix('.')} {where}.") from error


def _read_text(answer: str, shown: str) -> Quantity:
    """Read the last of several values that are said to be equal. Raises InvalidAnswer where they differ."""
    if len(answer) > CHARACTERS_MAX:
        raise InvalidAnswer(f"The answer is too long (at most {CHARACTERS_MAX} characters are read): type one number.")
    *others, last = [_read_side(side, shown) for side in sides(fold(answer))]
    for other in others:
        if abs(other.value - last.value) > AGREEMENT * max(abs(other.value), abs(last.value)):
            raise InvalidAnswer(f"{quoted(answer)} gives two answers, {other} and {last}: type the one that you mean.")
    return last


def sides(text: str) -> list[str]:
    """Split `h < 0.005 s = 5 ms` at its signs and drop the names. Raises InvalidAnswer for a bound or a range."""
    pieces = [piece.strip() for piece in RELATION.split(IS.sub("=", unwrapped(text)))]  # value, sign, ..., value
    if len(pieces) > 1 and pieces[0] and not pieces[-1]:
        raise InvalidAnswer(f"{quoted(text)} ends with a sign: type one number.")
    first = 0
    while first + 1 < len(pieces) and (not pieces[first] or NAME.fullmatch(pieces[first])):
        sign = pieces[first + 1]
        if not (set(sign) <= EQUAL or (pieces[first] and sign in BELOW)):
            raise not_one_number(text)
        first += 2
    if not all(set(sign) <= EQUAL for sign in pieces[first + 1 :: 2]):
        raise not_one_number(text)
    return [_without_hedge(unwrapped(piece)) for piece in pieces[first::2]]


def _without_hedge(text: str) -> str:
    """Drop words such as `about` from the front."""
    found = HEDGE.match(text)
    return text[found.end() :] if found else text


def unwrapped(text: str) -> str:
    """Drop parentheses, quotes or asterisks around the whole text."""
    for _ in range(WRAPPINGS_MAX):
        text = text.strip()
        if len(text) < 2 or WRAPPINGS.get(text[0]) != text[-1]:
            return text
        inner = text[1:-1]
        if text[0] in "([" and inner.find(text[-1]) < inner.find(text[0]):
            return text
        text = inner
    return text


def _as_float(answer: float) -> float:
    try:
        return finite(float(answer), str(answer)[:50])
    except (OverflowError, ValueError) as error:
        raise InvalidAnswer("The number is too large: type a finite number.") from error


def _same_label(typed: str, shown: str) -> bool:
    """Whether the typed word is the label of what is counted: `5 Steps` where the question counts `steps`."""
    return known_unit(shown) is None and typed.casefold().rstrip(".s") == shown.casefold().rstrip(".s")


def _read_side(text: str, shown: str) -> Quantity:
    """Read one number with or without a unit, in the unit `shown`. Raises InvalidAnswer."""
    number = read_number(text)
    if not number.rest or _same_label(number.rest, shown):
        return Quantity(number.value, number.value, None, shown)
    name = number.rest.rstrip(FULL_STOPS) or number.rest
    if found := SET_OFF.fullmatch(name):
        name = found[1] or found[2]
    try:
        typed = read_unit(name)
        if not shown:
            _require_proportion(typed)
        wanted = known_unit(shown) if shown else NO_UNIT
        if wanted is None:
            raise InvalidAnswer(f"{quoted(name)} is not what is counted")
        value = convert(number.value, typed, wanted)
    except InvalidAnswer as error:
        raise unreadable(text, number.rest, str(error)) from error
    return Quantity(finite(value, text), number.value, typed, shown)


def _require_proportion(typed: Unit) -> None:
    """Raise InvalidAnswer for a unit other than a percentage, where a plain number is asked."""
    if not {factor for factor, _ in typed.powers} <= PROPORTIONS:
        raise InvalidAnswer(f"{quoted(typed.text)} is a unit, but a plain number is asked")
