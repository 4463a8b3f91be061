"""Read numbers as people type them: decimal commas, grouped digits, powers of ten, fractions, multiples of pi. Expects
text that `spelling.fold` has brought to one spelling. No text is ever evaluated."""

import math
import re
from dataclasses import dataclass

from grader.domain.pages.markup import quoted
from grader.errors import InvalidAnswer

PI = r"(?:(?:np|numpy|[Mm]ath)\.|M_)?(?:pi|Pi|PI|π)(?![A-Za-z])"
NUMBER = re.compile(
    rf"""
    (?P<sign>[+-]?)\ ?
    (?:
        10\ ?(?:\^|\*\*)\ ?(?P<p>\()?(?P<power>[+-]?[0-9]+)(?(p)\))
      | (?P<whole>[0-9]+)\ (?P<part>[1-9][0-9]?)/(?P<parts>[1-9][0-9]?)(?![0-9.,]|\ ?/)
      | (?P<mantissa>(?=[.,]?[0-9])[0-9.,][0-9.,'_]*(?:\ (?!10\ ?(?:\^|\*\*)|1\ ?/\ ?[^\W\d])[0-9][0-9.,'_]*)*)
        (?:
            \ ?[eE](?P<exponent>[+-]?[0-9]+)
          | (?:\ ?[*xX]\ ?|\ )(?P<open>\()?10\ ?(?:\^|\*\*)\ ?(?P<s>\()?(?P<scale>[+-]?[0-9]+)(?(s)\))(?(open)\))
        )?
    )?
    (?:\ ?\*?\ ?(?P<pi>{PI}))?
    (?:\ ?/\ ?(?:(?P<over>[0-9]+(?:\.[0-9]*)?)(?![0-9.,])|(?P<over_pi>{PI})))?
    """,
    re.VERBOSE,
)
IN_PARENTHESES = re.compile(r"([+-]?) ?\(([^()]*)\)")

PLAIN = re.compile(r"[0-9]+\.?[0-9]*|\.[0-9]+")
AMBIGUOUS = re.compile(r"[1-9][0-9]{0,2},[0-9]{3}")
DECIMAL_COMMA = re.compile(r"[0-9]*,[0-9]+")
SPACED = re.compile(r"[1-9][0-9]{0,2}([ '_])[0-9]{3}(?:\1[0-9]{3})*(?:[.,][0-9]+)?")
COMMA_GROUPS = re.compile(r"[1-9][0-9]{0,2}(?:(?:,[0-9]{3})+\.[0-9]*|(?:,[0-9]{3}){2,})")
DOT_GROUPS = re.compile(r"[1-9][0-9]{0,2}(?:(?:\.[0-9]{3})+,[0-9]+|(?:\.[0-9]{3}){2,})")

NOT_FINITE = re.compile(r"[+-]? ?(?:nan|inf|infinity|∞)(?![a-z])", re.IGNORECASE)
BOUND = re.compile(
    r"(?:less|more|fewer|at most|at least|below|above|under|over|up to|greater|smaller|between|max|maximum|minimum"
    r"|no more|not more|no less|not less)\b",
    re.I,
)
BOUND_AFTER = re.compile(
    r"[\w%°] ?\b(?:(?:or|and) (?:less|lower|below|under|smaller|shorter|more|higher|above|over|greater|larger|longer)"
    r"|or so|max|maximum|at most|at least)[.,;!? ]*$",
    re.I,
)
"""The end of `5 ms or less`."""
UNCERTAIN = re.compile(r"±|\+/?-")
LOST_POWER = re.compile(r"[0-9] ?[*xX] ?10(?:-[0-9]|[1-9](?![0-9.,]))")
FACTOR = re.compile(rf" ?([*/]) ?(?=[0-9.(]|{PI})")
PI_NEXT = re.compile(rf" ?{PI}")
FACTORS_MAX = 8
DATE = re.compile(r"[0-9]+ ?/ ?[0-9]+ ?/ ?[0-9]+(?![0-9.,])")
CALCULATION = re.compile(
    r"[0-9)] ?[*/+] ?\(?[0-9.]|[0-9] ?(?:\^|\*\*) ?[(+-]?[0-9.]|(?<!\*)\* ?[0-9(]|[0-9]\([0-9]|[0-9]!|√"
    r"|[0-9] ?[xX] [0-9]|\b(?:sqrt|sin|cos|tan|asin|acos|atan|exp|log|ln)\b"
)
RANGE = re.compile(r"[0-9A-Za-z°%] - ?[0-9]|[0-9] ?- ?[0-9]|\.\.|…|[0-9A-Za-z°%] ?(?:to|or|and|bis|oder) [0-9]")


@dataclass(frozen=True)
class TypedNumber:
    """A finite number, and the text that followed it (its unit, or nothing)."""

    value: float
    rest: str


def read_number(text: str) -> TypedNumber:
    """Read the number at the start of a text. Raises InvalidAnswer where there is none, or more than one."""
    if not text:
        raise InvalidAnswer("The answer is empty: type a number.")
    if NOT_FINITE.match(text):
        raise InvalidAnswer(f"{quoted(text)} is not a finite number: type a finite number.")
    if BOUND.match(text) or BOUND_AFTER.search(text) or UNCERTAIN.search(text):
        raise not_one_number(text)
    if match := IN_PARENTHESES.match(text):
        inner = read_number(match[2].strip())
        if inner.rest:
            raise build_refusal(text, text, f"{quoted(text)} does not begin with a number")
        value, rest = -inner.value if match[1] == "-" else inner.value, text[match.end() :].strip()
        if times_pi := PI_NEXT.match(rest):
            value, rest = value * math.pi, rest[times_pi.end() :].strip()
        return multiply(TypedNumber(value, rest), text)
    match = NUMBER.match(text)
    if match is None or not (match["mantissa"] or match["power"] or match["whole"] or match["pi"]):
        raise build_refusal(text, text, f"{quoted(text)} does not begin with a number")
    check_order(match, text)
    return multiply(TypedNumber(_value_of(match, text), text[match.end() :].strip()), text)


def check_order(match: re.Match[str], text: str) -> None:
    """Raise InvalidAnswer where pi follows a fraction, as in `10/2pi`: it may belong above or below."""
    if match["over"] and PI_NEXT.match(match.string, match.end()):
        above = match[0].rpartition("/")[0].strip()
        one, other = quoted(f"{above}/{match['over']}*pi"), quoted(f"{above}/({match['over']}*pi)")
        raise InvalidAnswer(f"{quoted(text)} can mean {one} or {other}: type one of these two, or your number.")


def multiply(first: TypedNumber, text: str) -> TypedNumber:
    """Compute a product or quotient of numbers, from left to right; what follows it is its unit. Raises InvalidAnswer
    where it may be a power of ten without its sign, a date, or a division by zero."""
    value, rest = first.value, first.rest
    if not FACTOR.match(rest):
        return first
    if LOST_POWER.search(text) or DATE.search(text):
        raise build_refusal(text, rest, f"{quoted(text)} is a calculation")
    for _ in range(FACTORS_MAX):
        sign = FACTOR.match(rest)
        if sign is None:
            return TypedNumber(check_finite(value, text), rest)
        match = IN_PARENTHESES.match(rest, sign.end()) or NUMBER.match(rest, sign.end())
        factor = _read_factor(match, text)
        if sign[1] == "/" and factor == 0:
            raise InvalidAnswer(f"{quoted(text)} divides by zero: type a finite number.")
        value = value * factor if sign[1] == "*" else value / factor
        rest = rest[match.end() :].strip() if match else ""
    raise InvalidAnswer(f"{quoted(text)} is a long calculation: type its result.")


def _read_factor(match: re.Match[str] | None, text: str) -> float:
    """Return the value of one factor. Raises InvalidAnswer where it is no number."""
    if match is not None and match.re is IN_PARENTHESES:
        inner = read_number(match[2].strip())
        if not inner.rest:
            return inner.value
    elif match is not None and (match["mantissa"] or match["power"] or match["pi"]):
        check_order(match, text)
        return _value_of(match, text)
    raise InvalidAnswer(f"{quoted(text)} is a calculation: type its result.")


def not_one_number(text: str) -> InvalidAnswer:
    """Build the refusal of a bound or a range, such as `< 5` and `5 ± 1`."""
    return InvalidAnswer(f"{quoted(text)} is a bound or a range: type one number.")


def build_refusal(text: str, rest: str, otherwise: str) -> InvalidAnswer:
    """Build the refusal of a text whose `rest` cannot be read; gives the likeliest reason, by default `otherwise`."""
    scanned = rest if rest == text else f"1{rest}"  # the number before it is one operand
    if LOST_POWER.search(scanned):
        return InvalidAnswer(f"{quoted(text)} has a power of ten without its sign ^: write it as in 5e-3, and type it.")
    if RANGE.search(scanned):
        return InvalidAnswer(f"{quoted(text)} is a range or a calculation: type one number.")
    if CALCULATION.search(scanned):
        return InvalidAnswer(f"{quoted(text)} is a calculation: type its result.")
    return InvalidAnswer(otherwise if otherwise.endswith(".") else f"{otherwise}: type one number.")


def _value_of(match: re.Match[str], text: str) -> float:
    """Compute the value of a match of NUMBER, rounded once where it is one decimal literal."""
    exponent = match["exponent"] or match["scale"] or match["power"] or "0"
    if match["whole"]:
        value = _mixed(match, text)
    else:
        mantissa = read_digits(match["mantissa"], text) if match["mantissa"] else "1"
        value = float(f"{mantissa}e{exponent}")
        if value == 0 and float(mantissa) != 0:
            raise InvalidAnswer(f"{quoted(text)} is too small to be told from zero: type another number.")
    if match["pi"]:
        value *= math.pi
    if match["over"]:
        if float(match["over"]) == 0:
            raise InvalidAnswer(f"{quoted(text)} divides by zero: type a finite number.")
        value /= float(match["over"])
    if match["over_pi"]:
        value /= math.pi
    return check_finite(-value if match["sign"] == "-" else value, text)


def _mixed(match: re.Match[str], text: str) -> float:
    """Compute `12 1/2`. Raises InvalidAnswer for an improper fraction: `5 10/2` can be read in two ways."""
    part, parts = int(match["part"]), int(match["parts"])
    if part >= parts:
        raise _not_one_literal(text)
    return float(match["whole"]) + part / parts


def read_digits(digits: str, text: str) -> str:
    """Normalise grouped and separated digits to digits with one decimal point. Raises InvalidAnswer, which quotes
    `text`, the answer around the digits."""
    if "." in digits[:-1]:
        digits = digits.removesuffix(".")  # the full stop of a sentence
    if PLAIN.fullmatch(digits):
        return digits
    if AMBIGUOUS.fullmatch(digits):
        point, none = (quoted(text.replace(digits, digits.replace(",", mark))) for mark in (".", ""))
        raise InvalidAnswer(f"{quoted(text)} can mean {point} or {none}: type one of these two, or your number.")
    if DECIMAL_COMMA.fullmatch(digits):
        return digits.replace(",", ".")
    if SPACED.fullmatch(digits):
        return re.sub("[ '_]", "", digits).replace(",", ".")
    if COMMA_GROUPS.fullmatch(digits):
        return digits.replace(",", "")
    if DOT_GROUPS.fullmatch(digits):
        return digits.replace(".", "").replace(",", ".")
    raise _not_one_literal(text)


def _not_one_literal(text: str) -> InvalidAnswer:
    """Build the refusal without the advice to drop separators: `5,5,0` may mean 5.5, and 550 is another number."""
    return InvalidAnswer(
        f"{quoted(text)} cannot be read as one number: "
        "put nothing but a decimal point between its digits, as in 1234.5, and type it."
    )


def check_finite(value: float, text: str) -> float:
    """Return the value itself. Raises InvalidAnswer where it is not finite."""
    if math.isnan(value):
        raise InvalidAnswer(f"{quoted(text)} is not a finite number: type a finite number.")
    if math.isinf(value):
        raise InvalidAnswer(f"{quoted(text)} is too large: type a finite number.")
    return value
