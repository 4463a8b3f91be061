"""Numbers as people read them: few figures, true minus signs, and no line break before a unit."""

import math
import re

from markupsafe import Markup, escape

NARROW = "\u202f"
"""The narrow no-break space between a number and its unit."""

WIDE = "\u00a0"
"""The no-break space before a word, and between the factors of a unit."""

MINUS = "−"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

FRACTIONS = {"1/2": "½", "1/3": "⅓", "1/6": "⅙"}

SPANS = {86_400: "day", 3600: "hour", 60: "minute"}

WORDS = ("point", "attempt", "step", "line")
UNITS = rf"ms|µs|s|min|h|kg|g|mm|cm|km|m|rad|deg|°C?|Hz|kHz|N|Nm|J|W|Pa|K|V|A|KB|MB|GB|kB|%|(?:{'|'.join(WORDS)})s?"
UNIT = rf"(?:{UNITS})[²³]?(?!\w)"
AMOUNT = re.compile(rf"(?<=\d) {UNIT}(?:[ ·/]{UNIT})*")
"""What follows a number: a unit, or a product of units such as ` N m s/rad`."""

SCIENTIFIC = re.compile(r"(?<![\w.])(\d(?:\.\d+)?)e([+-]?\d{2,3})(?!\w)")
SHORT_WORDS = frozenset(("a", "an", "at", "in", "is", "it", "no", "of"))
CODE = re.compile("`([^`]*)`")
NEGATIVE = re.compile(r"(?<![\w.−-])-(?=\d)")


def write_number(value: float | None, digits: int = 4) -> str:
    """At most `digits` significant figures: `19.98`, `−2.5`, `1.9·10⁻³`; a dash for None."""
    if value is None:
        return "–"
    if not math.isfinite(value):
        return "not a number" if math.isnan(value) else f"{MINUS if value < 0 else ''}∞"
    size = abs(value)
    if size != 0 and not 1e-3 <= size < 1e6:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        factor = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        return f"{'' if factor == '1' else f'{factor}·'}10{write_power(int(exponent))}".replace("-", MINUS)
    return write_plain(value, digits).replace("-", MINUS)


def write_plain(value: float, digits: int) -> str:
    """Returns a number of moderate size without an exponent."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.0f}" if rounded == int(rounded) else repr(rounded)


def write_power(exponent: int) -> str:
    """Returns an exponent in superscript figures."""
    return str(exponent).translate(SUPERSCRIPTS)


def write_quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """Returns a number and its unit, never parted by the end of a line."""
    return f"{write_number(value, digits)}{NARROW}{unit}"


def write_fraction(text: str) -> str:
    """Returns a coefficient of a tableau: the commonest fractions as one sign."""
    return FRACTIONS.get(text, text.replace("-", MINUS))


def write_points(value: float) -> str:
    """Points to two decimals, without trailing zeros."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


def write_span(seconds: float) -> str:
    """Says how long something has lasted, in its largest unit: `3 days`, `1 hour`, `under a minute`."""
    for size, unit in SPANS.items():
        if (whole := int(seconds // size)) >= 1:
            return f"{whole}{NARROW}{unit}{'' if whole == 1 else 's'}"
    return "under a minute"


def capitalize(text: str) -> str:
    """Returns a sentence or a title with a capital letter, unless it begins with a symbol such as `kp = 2000`."""
    first = text.partition(" ")[0]
    return text[:1].upper() + text[1:] if len(first) > 2 or first in SHORT_WORDS else text


def remark(text: str) -> Markup:
    """Returns a remark on content as it is shown: with a capital letter, and what stands between backticks as code."""
    return mark_code(capitalize(text) if text[:1].isalpha() else text)


def mark_code(text: str) -> Markup:
    """Returns an unbroken text in which what stands between backticks is code."""
    return Markup(CODE.sub(r"<code>\1</code>", str(escape(keep_unbroken(text)))))  # noqa: S704  # escaped


def keep_unbroken(text: str) -> str:
    """A plain text whose numbers keep their units on the same line, and have true minus signs and powers of ten."""
    text = SCIENTIFIC.sub(lambda match: f"{match[1]}·10{write_power(int(match[2]))}", text)
    return NEGATIVE.sub(MINUS, join_units(text))


def join_unit(match: re.Match[str]) -> str:
    """A unit after its space, which is narrow before a symbol; words and the factors of a unit stand further apart."""
    unit = match[0][1:]
    return (WIDE if unit.startswith(WORDS) else NARROW) + unit.replace(" ", WIDE)


def join_units(text: str, *, is_after_number: bool = False) -> str:
    """A text in which no line ends between a number and its unit; `is_after_number`: the text follows a number."""
    joined = AMOUNT.sub(join_unit, f"0{text}" if is_after_number else text)
    return joined[1:] if is_after_number else joined
