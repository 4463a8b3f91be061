"""Numbers as people type them: decimal commas, grouped digits, powers of ten, fractions, multiples of pi."""

import math
import re
import unicodedata
from dataclasses import dataclass

from grader.errors import InvalidAnswer

CHARACTERS_MAX = 100
"""Longer texts are no number with a unit."""

FOLDED = str.maketrans(
    {
        **dict.fromkeys("−–‐‑‒﹣－", "-"),
        **dict.fromkeys("×✕⋅·∙•", "*"),
        **dict.fromkeys("’‘ʼ", "'"),
        "⁄": "/",
        "∕": "/",
        "÷": "/",
    }
)
SUPERSCRIPTS = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")

PREFIX = re.compile(r"(?:[A-Za-z][A-Za-z0-9_]{0,10} ?)?[=≈~]+ ?")
NUMBER = re.compile(
    r"""
    (?P<sign>[+-]?)\ ?
    (?:
        10\ ?(?:\^|\*\*)\ ?\(?(?P<power>[+-]?[0-9]+)\)?
      | (?P<mantissa>[0-9.,][0-9.,'_]*(?:\ [0-9][0-9.,'_]*)*)
        (?:
            [eE](?P<exponent>[+-]?[0-9]+)
          | \ ?[*xX]\ ?10\ ?(?:\^|\*\*)\ ?\(?(?P<scale>[+-]?[0-9]+)\)?
        )?
    )?
    (?:\ ?\*?\ ?(?P<pi>pi|π)(?![A-Za-z]))?
    (?:\ ?/\ ?(?P<over>[0-9]+(?:\.[0-9]+)?)(?![0-9.,]))?
    """,
    re.VERBOSE,
)

PLAIN = re.compile(r"[0-9]+\.?[0-9]*|\.[0-9]+")
AMBIGUOUS = re.compile(r"[1-9][0-9]{0,2},[0-9]{3}")
DECIMAL_COMMA = re.compile(r"[0-9]*,[0-9]+")
SPACED = re.compile(r"[1-9][0-9]{0,2}([ '_])[0-9]{3}(?:\1[0-9]{3})*(?:[.,][0-9]+)?")
COMMA_GROUPS = re.compile(r"[1-9][0-9]{0,2}(?:(?:,[0-9]{3})+\.[0-9]*|(?:,[0-9]{3}){2,})")
DOT_GROUPS = re.compile(r"[1-9][0-9]{0,2}(?:(?:\.[0-9]{3})+,[0-9]+|(?:\.[0-9]{3}){2,})")

NOT_FINITE = re.compile(r"[+-]?(?:nan|inf|infinity|∞)(?![a-z])", re.IGNORECASE)
NOT_ONE = re.compile(r"^[<>≤≥]|±|\+/?-")


@dataclass(frozen=True)
class TypedNumber:
    """A finite number, and the text that followed it (its unit, or nothing)."""

    value: float
    rest: str


def fold(text: str) -> str:
    """One spelling for what looks alike: spaces, minus signs, times signs, superscripts (`10⁻³` to `10^-3`)."""
    text = re.sub("[⁺⁻⁰¹²³⁴-⁹]+", lambda run: "^" + run[0].translate(SUPERSCRIPTS), text)
    text = "".join(f" {c}" if c.isnumeric() and not c.isdecimal() else c for c in text)
    text = unicodedata.normalize("NFKC", text.translate(FOLDED)).translate(FOLDED)
    return " ".join(text.split())


def quoted(text: str) -> str:
    """What a student typed, safe to repeat in a sentence: printable and short."""
    clean = "".join(c if c.isprintable() else " " for c in text[:200]).strip()
    return f'"{clean[:40]}…"' if len(clean) > 40 else f'"{clean}"'


def read_number(text: str) -> TypedNumber:
    """The number at the start of a text. Raises InvalidAnswer with the reason where there is none, or more than one."""
    text = text.strip()
    if not text:
        raise InvalidAnswer("The answer is empty: type a number.")
    if len(text) > CHARACTERS_MAX:
        raise InvalidAnswer(f"The answer is too long for a number: at most {CHARACTERS_MAX} characters are read.")
    folded = fold(text)
    if prefix := PREFIX.match(folded):
        folded = folded[prefix.end() :]
    if NOT_FINITE.match(folded):
        raise InvalidAnswer(f"{quoted(text)} is not a finite number.")
    if NOT_ONE.search(folded):
        raise InvalidAnswer(f"{quoted(text)} is a bound or a range: give one number alone.")
    found = NUMBER.match(folded)
    if found is None or not (found["mantissa"] or found["power"] or found["pi"]):
        raise InvalidAnswer(f"{quoted(text)} does not begin with a number.")
    return TypedNumber(number_value(found, text), folded[found.end() :].strip())


def number_value(found: re.Match[str], text: str) -> float:
    """The value of a match of NUMBER, rounded once where it is one decimal literal."""
    exponent = found["exponent"] or found["scale"] or found["power"] or "0"
    mantissa = read_mantissa(found["mantissa"]) if found["mantissa"] else "1"
    value = float(f"{mantissa}e{exponent}")
    if value == 0 and float(mantissa) != 0:
        raise InvalidAnswer(f"{quoted(text)} is too small to be told from zero.")
    if found["pi"]:
        value *= math.pi
    if found["over"]:
        if float(found["over"]) == 0:
            raise InvalidAnswer(f"{quoted(text)} divides by zero.")
        value /= float(found["over"])
    return finite(-value if found["sign"] == "-" else value, text)


def read_mantissa(text: str) -> str:
    """Digits with one decimal point, from digits as people group and separate them. Raises InvalidAnswer."""
    if PLAIN.fullmatch(text):
        return text
    if AMBIGUOUS.fullmatch(text):
        point, none = text.replace(",", "."), text.replace(",", "")
        raise InvalidAnswer(f"{quoted(text)} can mean {point} or {none}: write it without the comma.")
    if DECIMAL_COMMA.fullmatch(text):
        return text.replace(",", ".")
    if SPACED.fullmatch(text):
        return re.sub("[ '_]", "", text).replace(",", ".")
    if COMMA_GROUPS.fullmatch(text):
        return text.replace(",", "")
    if DOT_GROUPS.fullmatch(text):
        return text.replace(".", "").replace(",", ".")
    raise InvalidAnswer(f"The digits of {quoted(text)} cannot be read as one number: write them without separators.")


def finite(value: float, text: str) -> float:
    """The value itself. Raises InvalidAnswer where it is not finite."""
    if math.isnan(value):
        raise InvalidAnswer(f"{quoted(text)} is not a finite number.")
    if math.isinf(value):
        raise InvalidAnswer(f"{quoted(text)} is too large: give a finite number.")
    return value


def format_number(value: float) -> str:
    """As a student would write it: the rounding of a conversion between units does not show."""
    return f"{value:.12g}"
