"""Authors' texts, HTML with TeX between dollars: what a page shows of them, and how a formula becomes MathML."""

import html
import re
from xml.etree.ElementTree import Element, tostring

TOKEN = re.compile(r"<!--|</?(?P<name>[a-zA-Z][^\s/<>]*)[^<>]{0,2000}>|<|\\\$|\$")
"""A comment, a tag, a lone `<` or a dollar sign. Tags are short, as HTML5 compares all their attributes."""

DISPLAY = re.compile(r"\$\$((?:[^$\\]|\\.)++)\$\$", re.DOTALL)
INLINE = re.compile(r"\$(?![\s$])((?:[^$\\]|\\.)++)(?<!\s)\$(?!\d)", re.DOTALL)
"""An opening dollar is followed, a closing one preceded by a non-space."""

COMMENT_END = re.compile("-->")

VERBATIM = {tag: re.compile(rf"</{tag}\s*>", re.IGNORECASE) for tag in ("code", "pre", "kbd", "samp")}
"""Elements in which a dollar sign opens no formula, with their end tags."""

_MATHML = (
    "math mrow mi mn mo mtext mspace msup msub msubsup mfrac msqrt mroot mover munder munderover mtable mtr mtd "
    "mstyle mpadded mphantom menclose mmultiscripts mprescripts"
)
MATHML_TAGS = frozenset(_MATHML.split())
MATHML_ATTRIBUTES = {
    "math": {"display"},
    "mo": {"stretchy", "fence", "separator", "form", "minsize", "maxsize", "lspace", "rspace"},
    "mi": {"mathvariant"},
    "mspace": {"width"},
    "mfrac": {"linethickness"},
    "mover": {"accent"},
    "munder": {"accentunder"},
    "mstyle": {"displaystyle", "scriptlevel", "mathcolor"},
    "mtable": {"columnalign", "rowspacing", "columnspacing"},
    "mtd": {"columnalign"},
    "menclose": {"notation"},
}
_HTML = (
    "a abbr b blockquote br code dd del details div dl dt em figcaption figure h3 h4 h5 h6 hr i img ins kbd li mark "
    "ol p pre q s samp small span strong sub summary sup table tbody td tfoot th thead tr u ul var"
)
HTML_TAGS = frozenset(_HTML.split())
HTML_ATTRIBUTES = {
    "a": {"href", "title"},
    "abbr": {"title"},
    "img": {"src", "alt", "width", "height"},
    "ol": {"start"},
    "td": {"colspan", "rowspan"},
    "th": {"colspan", "rowspan", "scope"},
}

ATTRIBUTES = HTML_ATTRIBUTES | MATHML_ATTRIBUTES

URL_SCHEMES = frozenset(("http", "https", "mailto"))
"""The addresses that links and pictures may have."""


ALIASES = {"aligned": "split", "dcases": "cases", "gathered": "matrix", "gather": "matrix", "gather*": "matrix"}
"""Environments of TeX, and those of the library that are shown alike."""

ALIASED = re.compile(rf"\\(begin|end){{({'|'.join(map(re.escape, ALIASES))})}}")


def remove_comments(text: str) -> str:
    """Returns a text without its comments, as a page shows it; one that is not closed stays."""
    parts, position = list[str](), 0
    while (start := text.find("<!--", position)) >= 0 and (end := COMMENT_END.search(text, start)):
        parts.append(text[position:start])
        position = end.end()
    return "".join((*parts, text[position:]))


def render_tex(tex: str, display: str = "inline") -> str:
    """Converts TeX to MathML; TeX that cannot be parsed becomes `<code>`."""
    try:
        return tostring(convert_tex(tex, display), encoding="unicode")
    except Exception:  # its errors have no common class, and a typing error must not break the page
        return f"<code>{html.escape(tex)}</code>"


def convert_tex(tex: str, display: str = "inline") -> Element:
    """Returns the MathML of a formula. Unlike the library's own text, it holds no markup from inside `\\text{...}`.
    Raises an error of no common class for what is no TeX."""
    from latex2mathml import converter  # only pages and checks of content need it

    reader = converter.Converter(display=display)
    reader.macros = _NoMacros()
    tree = reader.convert_to_element(ALIASED.sub(lambda match: f"\\{match[1]}{{{ALIASES[match[2]]}}}", tex))
    for element in tree.iter():
        element.text = element.text and html.unescape(element.text)
    return tree


class _NoMacros(dict[str, tuple[list[str], int]]):
    """Refuses macros: repeated use makes a short formula arbitrarily long."""

    def __setitem__(self, name: str, _macro: tuple[list[str], int]) -> None:
        raise ValueError(f"{name}: macros are not supported")
