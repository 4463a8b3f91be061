"""Converts HTML to plain text, and quotes what was typed."""

import html
import re
import unicodedata
from functools import lru_cache
from html.parser import HTMLParser

import nh3

FORMULA = re.compile(r"\$([^$]*)\$")
GREEK = re.compile(r"\\([A-Za-z][a-z]+)(?![A-Za-z])")

LONE_BRACKET = re.compile(r"<(?!/?[A-Za-z][^<>$]*>|!--)")
"""A `<` that opens no tag. A tag holds no dollar sign: `$a<b$ and $c>d$` is TeX."""

BLOCK = re.compile(r"</?(?:p|pre|div|br|li|ul|ol|dl|dt|dd|table|tr|td|th|h[1-6]|blockquote|figure)\b", re.IGNORECASE)
"""What stands on lines of its own."""
PICTURE = re.compile(r"""<img\s[^<>]{0,2000}?\balt\s*=\s*(?:"([^"<>]*)"|'([^'<>]*)')[^<>]{0,2000}>""", re.IGNORECASE)


def plain_text(markup: str) -> str:
    """Strip the tags of an HTML fragment, decode its entities and collapse white space; TeX stays as typed. A picture
    is its description. Parses the fragment as HTML5, in time quadratic in the depth of its nesting. Half a surrogate
    pair becomes a question mark."""
    apart = BLOCK.sub(lambda match: f" {match[0]}", markup)
    described = PICTURE.sub(lambda match: match[1] or match[2] or "", apart)
    fragment = LONE_BRACKET.sub("&lt;", described).encode(errors="replace").decode()
    return " ".join(html.unescape(nh3.clean(fragment, tags=set(), link_rel=None)).split())


@lru_cache(maxsize=2048)
def spoken_text(markup: str) -> str:
    """Returns an HTML fragment as plain text, its formulas without dollars where they are plain text as well.
    Kept, since parsing HTML takes long."""
    return FORMULA.sub(
        lambda match: match[0] if "\\" in (spelled := spell_formula(match)) else spelled, plain_text(markup)
    )


def spell_formula(formula: re.Match[str]) -> str:
    """Returns a formula of TeX as plain text: Greek letters in place of their commands, no braces, indices as in kp."""
    return GREEK.sub(spell_letter, re.sub(r"[{}]|(?<=\w)_(?=[\w{])", "", formula[1]))


SIGNS = {"le": "≤", "leq": "≤", "ge": "≥", "geq": "≥", "ne": "≠", "approx": "≈", "pm": "±", "cdot": "·", "times": "×",
         "infty": "∞"}  # fmt: skip
"""Commands of TeX that are one sign."""


def spell_letter(command: re.Match[str]) -> str:
    """Returns the Greek letter or the sign of a command of TeX; any other command as it is."""
    if command[1] in SIGNS:
        return SIGNS[command[1]]
    name = command[1].replace("lambda", "lamda").replace("Lambda", "Lamda")  # as Unicode spells it
    try:
        return unicodedata.lookup(f"GREEK {'SMALL' if name.islower() else 'CAPITAL'} LETTER {name}")
    except KeyError:
        return command[0]


DIRECTIONS = str.maketrans({code: f"[U+{code:04X}]" for code in (0x61C, 0x200E, 0x200F, *range(0x202A, 0x202F),
                                                               *range(0x2066, 0x206A))})  # fmt: skip
"""Characters that order others and are not seen themselves. Source: Unicode Standard Annex 9."""


def show_directions(text: str) -> str:
    """Returns what was typed with its invisible marks of direction written out: with one, a script is read in another
    order than the one in which it runs."""
    return text.translate(DIRECTIONS)


class ImageReader(HTMLParser):
    """Keeps the attributes of the first picture of a text."""

    def __init__(self) -> None:
        super().__init__()
        self.attributes: dict[str, str] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Reads one tag."""
        if tag == "img" and not self.attributes:
            self.attributes = {name: value or "" for name, value in attrs}


def read_image(markup: str) -> dict[str, str]:
    """Returns the attributes of the first picture in an HTML text, such as `src` and `alt`; none without a picture."""
    reader = ImageReader()
    reader.feed(markup)
    return reader.attributes


def quoted(text: str, characters_max: int = 40) -> str:
    """Quote what a student typed, printable and short enough to repeat in a sentence."""
    clean = "".join(c if c.isprintable() else " " for c in text[:200]).strip()
    return f'"{clean[:characters_max]}…"' if len(clean) > characters_max else f'"{clean}"'
