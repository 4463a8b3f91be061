"""Authors' HTML with TeX between dollars, made into HTML with MathML that is safe to show."""

import html
import re

import nh3
from latex2mathml import converter
from markupsafe import Markup

TEX_LENGTH_MAX = 2000

TOKEN = re.compile(
    r"""
      (?P<verbatim> <(?P<tag>code|pre|kbd|samp)\b[^<>]*> .*? </(?P=tag)\s*> | <!--.*?--> | </?[a-zA-Z][^<>]*> )
    | (?P<dollar> \\\$ )
    | \$\$ (?P<display> (?:[^$\\]|\\.)+ ) \$\$
    | \$ (?! [\s$]) (?P<inline> (?:[^$\\]|\\.)+? ) (?<! \s) \$ (?! \d)
    """,
    re.VERBOSE | re.DOTALL | re.IGNORECASE,
)
"""What is not plain text. A dollar opens mathematics only before a non-space and closes it only after one."""

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

_CLEANER = nh3.Cleaner(
    tags=set(HTML_TAGS | MATHML_TAGS),
    attributes=HTML_ATTRIBUTES | MATHML_ATTRIBUTES,
    url_schemes={"http", "https", "mailto"},
    link_rel="noopener noreferrer",
)


def safe_html(prose: str) -> Markup:
    """`prose` with its TeX as MathML, and nothing in it that could run or load as code.

    TeX inside code, pre, kbd and samp stays as it is; `\\$` is a dollar sign.
    """
    clean = _CLEANER.clean(TOKEN.sub(_mathematics, prose))  # sanitised last: MathML is no safer than its TeX
    return Markup(clean)  # noqa: S704


def plain_text(prose: str) -> str:
    """`prose` without its tags, for titles and labels; TeX stays as typed."""
    return html.unescape(nh3.clean(prose, tags=set(), link_rel=None)).strip()


def _mathematics(token: re.Match[str]) -> str:
    if token["verbatim"] is not None:
        return token["verbatim"]
    if token["dollar"] is not None:
        return "$"
    if token["display"] is not None:
        return mathml(html.unescape(token["display"]), "block")
    return mathml(html.unescape(token["inline"]), "inline")


def mathml(tex: str, display: str = "inline") -> str:
    """`tex` as MathML, not yet sanitised; TeX that cannot be read is shown as it was typed."""
    if len(tex) <= TEX_LENGTH_MAX:
        try:
            return converter.convert(tex, display=display)
        except Exception:  # noqa: S110 - its errors have no common root, and a typing slip must not take the page down
            pass
    return f"<code>{html.escape(tex)}</code>"
