"""Read a typed answer to a numeric question: a number, with or without a unit, in the unit of the question."""

import re
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

from grader.domain.pages.markup import quoted
from grader.errors import InvalidAnswer
from grader.questions.kinds.number.numbers import (
    CALCULATION,
    RANGE,
    build_refusal,
    check_finite,
    not_one_number,
    read_number,
)
from grader.questions.kinds.number.phrases import (
    NON_BREAKING,
    drop_bound,
    find_asked_bound,
    split_remark,
)
from grader.questions.kinds.number.spelling import fold, without_markup
from grader.questions.kinds.number.units import Unit, convert, from_base_units, known_unit, read_unit

CHARACTERS_MAX = 200
"""The longest text that is read; tags and TeX count."""

PROPORTIONS = {"percent", "permille", "ppm"}
"""Units that a question without a unit accepts."""

NO_UNIT = Unit("", ())

RELATION = re.compile(r"(<- |->|[=<>≤≥≈~:≠→]+)")
"""A sign between two values. `<- ` is read as neither an arrow nor a negative bound."""

EQUAL = frozenset("=≈~→")
BELOW = frozenset({"<", "<=", "=<", "≤", ":", ":="})

NAME = re.compile(
    r"(?!(?:not|pi|π)\b)"
    r"(?:(?:the|a|my|max|maximum|min|minimum|largest|smallest|stable|critical|time|step|Δ|d|delta) ){0,4}"
    r"[^\W\d]\w{0,15}(?: [0-9]| max| min|\^?\*|')?",
    re.IGNORECASE,
)
"""Names that may precede the sign in `h < 5 ms`; other words could change the meaning, as in `log h = 5`."""

IS = re.compile(r" (?:is|equals|ist|should be|must be) ", re.I)
"""Reads `h is 5 ms` as `h = 5 ms`."""

HEDGE = re.compile(
    r"(?:about|around|approximately|app?rox\.?|roughly|exactly|nearly|almost|just|maybe|probably|circa|cc?a\.?|etwa"
    r"|ungefähr|rund|environ|env\.|около|примерно"
    r"|so|thus|hence|therefore|∴|⇒|=>|(?:I|we) (?:get|got|find|found|think|guess)|I'd say|(?:it|that|h) would be"
    r"|it ?['i]s)(?:,? |(?<=\.)|(?=[0-9]))",
    re.I,
)
HEDGES_MAX = 3
HEDGE_AFTER = re.compile(r"[ ,]\(?(?:about|approximately|app?rox\.?|roughly|circa|ca\.?|I (?:think|guess))\)?$", re.I)
"""Words before a number (`I get about 5 ms`) and after its unit (`5 ms approx.`) that do not change the number."""

MINUS = re.compile(r"(?:minus|negative) (?=[0-9.,(π])", re.I)
"""A dictated sign."""

FORMULA = re.compile(
    r"(?:[0-9]++(?:[.,][0-9]++)?+|(?!(?:or|no|to|if)\b)(?:sqrt|pi|[^\W\d_]{1,2})(?:_\w{1,9}+|[0-9](?![0-9]))?+(?![^\W\d])"
    r"|[-+*/^()√ ])++"
)
"""Numbers and symbols of one or two letters, as between the name and the value in `h = 2I/c = 5 ms`."""

AGAIN = re.compile(r",? (?:or|i\.e\.|that is|aka|oder),? ")
AGAIN_IN_PARENTHESES = re.compile(r",? \(([^()]*)\)$")
"""What precedes the same value in another unit: `0.005 s or 5 ms`, `0.005 s (5 ms)`."""

METRES_PER = re.compile(r"\bms(?=(?:\^|\*\*)? ?\(?-[1-9])")
"""The metres and seconds of `9.81 ms^-2`, read so only where milliseconds do not fit."""

INTERVAL = re.compile(r"[\[(][-+]?[0-9]+,[0-9]+[])]")
"""Two whole numbers in brackets, or one with a decimal comma: `[5,6]`."""

WRAPPINGS = {"(": ")", "[": "]", '"': '"', "'": "'", "`": "`", "*": "*", "_": "_"}
WRAPPINGS_MAX = 4
FULL_STOPS = ".,;!? "
"""Punctuation that may follow a unit; after a bare number it could change the value: `5!` is 120."""

SET_OFF = re.compile(r"\[([^][]+)\]|-([A-Za-zμ].*)")
"""The unit of `5 [ms]` and `5-ms`."""

AGREEMENT = 1e-3
"""Relative difference up to which both sides of `1/3 = 0.3333` are the same answer."""


DIGITS, DIGITS_MAX = 6, 12
"""Significant digits of a number that is told: 12 still hide the rounding of a conversion between units."""


def format_number(value: float, *others: float, digits: int = DIGITS) -> str:
    """Write a number with so many digits, 6 at least and 12 at most; with more where `others` that differ would look
    alike."""
    for count in range(min(max(digits, DIGITS), DIGITS_MAX), DIGITS_MAX):
        text = f"{value:.{count}g}"
        if all(other == value or f"{other:.{count}g}" != text for other in others):
            return text
    return f"{value:.{DIGITS_MAX}g}"


@dataclass(frozen=True)
class Quantity:
    """An answer as it was understood: `value` in the question's `unit`, from a `number` in the `typed_unit`, which was
    typed with so many `digits`."""

    value: float
    number: float
    typed_unit: Unit | None
    unit: str
    left_out: str = ""
    """A remark behind the answer that was not read."""
    digits: int = 0

    @cached_property
    def text(self) -> str:
        """The answer in the question's unit, `5 ms`, with a digit more than was typed: what was typed in other digits
        looks different."""
        return f"{format_number(self.value, digits=self.digits + 1)} {self.unit}".strip()

    @property
    def echo(self) -> str:
        """The answer, and what was left out of it."""
        return f"{self.text} (left out: {quoted(self.left_out)})" if self.left_out else self.text

    def __str__(self) -> str:
        """The answer in the question's unit."""
        return self.text


def read_quantity(answer: Any, unit: str | None, question: str = "") -> Quantity:
    """Read a JSON number or a text, and convert it to the question's unit, which is assumed where none is typed. Where
    the text of the `question` asks for a bound, one of that side is a number. Raises InvalidAnswer with one sentence:
    why the answer cannot be read, and what would be readable."""
    shown = _read_label(unit or "")
    try:
        if isinstance(answer, str):
            return _read_text(answer, shown, question)
        if isinstance(answer, int | float) and not isinstance(answer, bool):
            value = _as_float(answer)
            return Quantity(value, value, None, shown, digits=count_digits(repr(value)))
        raise InvalidAnswer("The answer must be a number, or a text: type one number.")
    except InvalidAnswer as error:
        where = f"in {shown}" if shown else "without a unit"
        raise InvalidAnswer(f"{str(error).removesuffix('.')} {where}.") from error


@lru_cache(maxsize=1024)
def _read_label(unit: str) -> str:
    """The unit of a question as plain text."""
    return without_markup(unit)


def _read_text(answer: str, shown: str, question: str) -> Quantity:
    """Read the last of several values that are said to be equal; if that fails, without a bound or a remark. Raises
    InvalidAnswer where they differ."""
    if len(answer) > CHARACTERS_MAX:
        raise InvalidAnswer(f"The answer is too long (at most {CHARACTERS_MAX} characters are read): type one number.")
    text = NON_BREAKING.sub(" ", fold(answer))
    try:
        return _read_values(text, shown)
    except InvalidAnswer:
        with suppress(InvalidAnswer):
            return _read_phrase(text, shown, question)
        raise


def _read_phrase(text: str, shown: str, question: str) -> Quantity:
    """Read an answer without the words of a bound, and without a remark behind it. Raises InvalidAnswer."""
    plain, remark = split_remark(text)
    if remark and _is_other_unit(remark, plain, shown):
        raise InvalidAnswer(f"{quoted(text)} has two units")
    if (asks := find_asked_bound(question)) is not None:
        plain = drop_bound(plain, asks)
    if plain == text:
        raise InvalidAnswer(f"{quoted(text)} has neither a bound nor a remark")
    return replace(_read_values(plain, shown), left_out=remark)


def _is_other_unit(remark: str, plain: str, shown: str) -> bool:
    """Whether a remark is a unit, and not that of the answer before it."""
    unit = known_unit(remark)
    return unit is not None and unit.powers != (_read_values(plain, shown).typed_unit or unit).powers


def _read_values(text: str, shown: str) -> Quantity:
    """Read the last of several values that are said to be equal. Raises InvalidAnswer where they differ."""
    try:
        return _read_sides(text, shown)[-1]
    except InvalidAnswer:
        with suppress(InvalidAnswer):
            read = _read_sides(AGAIN.sub("=", AGAIN_IN_PARENTHESES.sub(r"=\1", text)), shown)
            if len(read) > 1 and all(quantity.typed_unit for quantity in read[1:]):
                return read[-1]
        raise


def _read_sides(text: str, shown: str) -> list[Quantity]:
    """Read every side but names and formulas. Raises InvalidAnswer where two values differ."""
    named, (*others, last_text) = sides(text)
    last = _read_side(last_text, shown)
    read = [_read_side(other, shown) for other in others if not _is_formula(other, named=named)]
    for other in read:
        same_number = other.typed_unit is None and (
            _agree(other.number, last.number) or _is_in_base_units(other.number, last)
        )
        if not same_number and not _agree(other.value, last.value):
            raise InvalidAnswer(f"{quoted(text)} gives two answers, {other} and {last}: type the one that you mean.")
    return [*read, last]


def _is_in_base_units(number: float, quantity: Quantity) -> bool:
    """Whether a bare number is a quantity in base units: the 0.005 of `0.005 = 5 ms`."""
    unit = known_unit(quantity.unit) if quantity.typed_unit else None
    return unit is not None and _agree(from_base_units(number, unit), quantity.value)


def _agree(first: float, second: float) -> bool:
    return abs(first - second) <= AGREEMENT * max(abs(first), abs(second))


def _is_formula(text: str, *, named: bool) -> bool:
    """Whether a side is a calculation whose result follows; with letters only after a name: `2h = 5 ms` is none."""
    if not FORMULA.fullmatch(text) or RANGE.search(text) or not (named or not re.search(r"[^\W\d]", text)):
        return False
    try:
        rest = read_number(text).rest
    except InvalidAnswer:
        return bool(CALCULATION.search(text)) or text[0].isalpha()
    return bool(rest) and known_unit(rest) is None


def sides(text: str) -> tuple[bool, list[str]]:
    """Split `h < 0.005 s = 5 ms` at its signs and drop the names; also tell whether there was a name. Raises
    InvalidAnswer for a bound or a range."""
    text = unwrap(text)
    pieces = [piece.strip() for piece in RELATION.split(IS.sub("=", _without_hedge(text)))]  # value, sign, ..., value
    if len(pieces) > 1 and pieces[0] and not pieces[-1]:
        raise InvalidAnswer(f"{quoted(text)} ends with a sign: type one number.")
    first = 0
    while first + 1 < len(pieces) and (not pieces[first] or NAME.fullmatch(pieces[first])):
        sign = pieces[first + 1]
        if not (_is_equal(sign) or (pieces[first] and sign in BELOW)):
            raise not_one_number(text)
        first += 2
    if not all(_is_equal(sign) for sign in pieces[first + 1 :: 2]):
        raise not_one_number(text)
    return any(pieces[:first:2]), [_without_hedge(unwrap(piece)) for piece in pieces[first::2]]


def _is_equal(sign: str) -> bool:
    return sign == "->" or set(sign) <= EQUAL


def _without_hedge(text: str) -> str:
    """Drop words such as `about` from the front and the end."""
    for _ in range(HEDGES_MAX):
        match = HEDGE.match(text)
        text = text[match.end() :] if match else text
    return HEDGE_AFTER.sub("", text)


def unwrap(text: str) -> str:
    """Drop parentheses, quotes or asterisks around the whole text. Raises InvalidAnswer where they may hold an
    interval."""
    for _ in range(WRAPPINGS_MAX):
        text = text.strip()
        if len(text) < 2 or WRAPPINGS.get(text[0]) != text[-1]:
            return text
        inner = text[1:-1]
        if INTERVAL.fullmatch(text):
            point = quoted(inner.replace(",", "."))
            raise InvalidAnswer(f"{quoted(text)} can mean {point} or an interval: type one number.")
        if text[0] in "([" and inner.find(text[-1]) < inner.find(text[0]):
            return text
        text = inner
    return text


def _as_float(answer: float) -> float:
    try:
        return check_finite(float(answer), str(answer)[:50])
    except (OverflowError, ValueError) as error:
        raise InvalidAnswer("The number is too large: type a finite number.") from error


def _same_label(typed: str, shown: str) -> bool:
    """Whether the typed word is the label of what is counted: `5 time steps` where the question counts `steps`."""
    word = typed.casefold().removeprefix("time").strip()
    return bool(shown) and known_unit(shown) is None and word.rstrip(".s") == shown.casefold().rstrip(".s")


def _read_side(text: str, shown: str) -> Quantity:
    """Read one number with or without a unit, in the unit `shown`. Raises InvalidAnswer."""
    number = read_number(MINUS.sub("-", text, count=1) if MINUS.match(text) else text)
    if not number.rest or _same_label(number.rest, shown):
        return Quantity(number.value, number.value, None, shown, digits=count_digits(text))
    name = number.rest.rstrip(FULL_STOPS) or number.rest
    if match := SET_OFF.fullmatch(name):
        name = match[1] or match[2]
    digits = count_digits(text.removesuffix(number.rest))
    try:
        return replace(_convert(number.value, name, shown), digits=digits)
    except InvalidAnswer as error:
        if (apart := METRES_PER.sub("m s", name)) != name:
            with suppress(InvalidAnswer):
                return replace(_convert(number.value, apart, shown), digits=digits)
        raise build_refusal(text, number.rest, str(error)) from error


def count_digits(text: str) -> int:
    """Returns how many digits a number was typed with, at least those that are significant."""
    return sum(character.isdigit() for character in text)


def _convert(number: float, name: str, shown: str) -> Quantity:
    """Convert a number in the unit `name` to the unit `shown`. Raises InvalidAnswer."""
    typed = read_unit(name)
    wanted = known_unit(shown) if shown else NO_UNIT
    if wanted is None:
        raise InvalidAnswer(f"{quoted(name)} is not what is counted")
    if "pi" in dict(typed.powers) and "pi" not in dict(wanted.powers):  # which pint knows as a unit
        raise InvalidAnswer(f"{quoted(name)} has pi where the unit stands: type parentheses, as in 10/(2*pi)")
    if not shown:
        _require_proportion(typed)
    return Quantity(check_finite(convert(number, typed, wanted), f"{number:g} {name}"), number, typed, shown)


def _require_proportion(typed: Unit) -> None:
    """Raise InvalidAnswer for a unit other than a percentage, where a plain number is asked."""
    if not {factor for factor, _ in typed.powers} <= PROPORTIONS:
        raise InvalidAnswer(f"{quoted(typed.text)} is a unit, but a plain number is asked")
