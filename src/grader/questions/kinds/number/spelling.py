"""Normalise spelling: tags, TeX, the digits of every script, dashes and multiplication signs."""

import re
import unicodedata
from collections.abc import Mapping

from grader.domain.pages.markup import plain_text

LOOKALIKES = str.maketrans(
    {
        **dict.fromkeys("−–‐‑‒﹣－", "-"), **dict.fromkeys("×✕⋅·∙•", "*"), **dict.fromkeys("’‘ʼ٬", "'"),
        **dict.fromkeys("“”„«»", '"'), **dict.fromkeys("⁄∕÷", "/"), **dict.fromkeys("º˚∘", "°"),
        **dict.fromkeys("≃≅≒", "≈"), **dict.fromkeys("∼～〜", "~"), **dict.fromkeys("⩽≦≲⪅", "≤"),
        **dict.fromkeys("≐≡≔", "="), **dict.fromkeys("⩾≧", "≥"), "∆": "Δ", "٫": ".", **dict.fromkeys("،‚", ","),
        "。": ".", "٪": "%", "⟶": "→",
    }
)  # fmt: skip
SUPERSCRIPT = re.compile("[⁺⁻⁰¹²³⁴-⁹]+")
SUPERSCRIPTS = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")

MARKUP = re.compile(r"</?[A-Za-z][^<>]*>|&[A-Za-z#]")
TAGS_WITH_A_MEANING = (("<sup>", "^"), ("<sub>", "_"), ("<", " <"))
"""A space before every other tag keeps `5<br>0` two numbers."""

TEX_FONT = re.compile(r"([_^]?)\\(?:math(?:rm|it|bf|sf)|text(?:rm|bf|it)?|mbox|boxed) ?\{([^{}]*)\}")
TEX_FRACTION = re.compile(r"\\[dt]?frac ?(?:\{([^{}]*)\}|([0-9]|\\pi)) ?(?:\{([^{}]*)\}|([0-9]))")
TEX_COMMAND = re.compile(r"\\([A-Za-z]+|.)")
TEX_RAISED = re.compile(r"([_^])\{ *([^{}]*?) *\}")
MICRO = re.compile("μ +")
TEX_COMMANDS: Mapping[str, str] = {
    **dict.fromkeys([*",;:! ()[]", "quad", "qquad", "left", "right"], " "),
    **dict.fromkeys(["mathrm", "mathit", "mathbf", "mathsf", "text", "textrm", "mbox", "rm", "operatorname"], " "),
    **dict.fromkeys(["SI", "si", "qty", "num", "unit", "boxed", "displaystyle"], " "),
    **dict.fromkeys(["circ", "degree"], "°"), **dict.fromkeys(["le", "leq", "leqslant", "lesssim"], "≤"),
    **dict.fromkeys(["ge", "geq", "geqslant"], "≥"), **dict.fromkeys(["ne", "neq", "not"], "≠"), "times": "×",
    "cdot": "·", "pi": "π", "mu": "μ", "Omega": "Ω", "Delta": "Δ",
    **dict.fromkeys(["approx", "sim", "simeq", "cong"], "≈"),
    **dict.fromkeys(["to", "rightarrow", "Rightarrow", "implies"], "→"), "lt": "<", "gt": ">", "pm": "±", "infty": "∞",
    "%": "%",
}  # fmt: skip
"""Other commands are read as their own name (`\\omega`, `\\max`)."""


def fold(text: str) -> str:
    """Remove markup and normalise spelling (`10⁻³` to `10^-3`, `٥` to `5`), in linear time. A digit in another position
    (`½`, `₂`, `①`) is set apart by spaces: `2½` does not become 21/2."""
    text = without_markup(text)
    if text.isascii():
        return text
    text = SUPERSCRIPT.sub(lambda run: "^" + run[0].translate(SUPERSCRIPTS), text)
    text = "".join(f" {c} " if c.isnumeric() and not c.isdecimal() else c for c in text)
    text = unicodedata.normalize("NFKC", text.translate(LOOKALIKES)).translate(LOOKALIKES)
    return " ".join("".join(map(_fold_character, text)).split())


def _fold_character(c: str) -> str:
    if c.isascii():
        return c
    if c.isdecimal():
        return str(unicodedata.decimal(c))
    return "" if unicodedata.category(c) == "Cf" else c  # invisible: direction marks, joiners, invisible times


def without_markup(text: str) -> str:
    """Turn HTML and TeX into the plain text that they show: `m/s<sup>2</sup>` and `$m/s^{2}$` into `m/s^2`."""
    if MARKUP.search(text):
        for tag, shown in TAGS_WITH_A_MEANING:
            text = text.replace(tag, shown)
        text = plain_text(text)
    paired = "$" in text and text.count("$") % 2 == 0
    if paired or "\\" in text or TEX_RAISED.search(text):
        text = _without_tex(text.replace("$", " ") if paired else text)
    return " ".join(text.split())


def _without_tex(text: str) -> str:
    """Turn TeX into plain text. Braces become spaces: `5{6}` does not become 56."""
    text = text.replace("{,}", ",").replace("~", " ")
    text = TEX_FRACTION.sub(_tex_fraction, TEX_FONT.sub(_tex_font, text))
    text = TEX_COMMAND.sub(_tex_command, text)
    text = TEX_RAISED.sub(r"\1\2 ", text).replace("{", " ").replace("}", " ")
    return MICRO.sub("μ", text).replace("^° ", "°").replace("^°", "°")


def _tex_font(match: re.Match[str]) -> str:
    return f"{match[1]}{{{match[2]}}}" if match[1] else f" {match[2]} "


def _tex_fraction(match: re.Match[str]) -> str:
    above, below = match[1] or match[2] or "", match[3] or match[4] or ""
    return f"({above})/({below})" if r"\pi" in below else f"({above}/{below})"


def _tex_command(match: re.Match[str]) -> str:
    name = match[1]
    return TEX_COMMANDS.get(name, name if name.isalpha() else match[0])
