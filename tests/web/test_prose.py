"""Authors' HTML and TeX become HTML and MathML that is safe to show."""

import re
from html.parser import HTMLParser

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grader.domain.pages.markup import plain_text, read_image, spoken_text
from grader.domain.pages.prose import (
    HTML_ATTRIBUTES,
    HTML_TAGS,
    MATHML_ATTRIBUTES,
    MATHML_TAGS,
    render_tex,
)
from grader.library.checking.prose_remarks import explain_tex
from grader.web.text.prose import TAGS_MAX, TEX_BUDGET, safe_html


class Tags(HTMLParser):
    """Every tag with its attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))


def assert_harmless(text: str) -> None:
    for tag, attributes in Tags(text).seen:
        assert tag in HTML_TAGS | MATHML_TAGS, tag
        allowed = HTML_ATTRIBUTES.get(tag, set()) | MATHML_ATTRIBUTES.get(tag, set()) | {"rel"}
        assert set(attributes) <= allowed, (tag, attributes)
        for link in (attributes.get("href"), attributes.get("src")):
            assert not re.match(r"[\s\x00-\x1f]*(javascript|data|vbscript):", link or "", re.IGNORECASE)


@pytest.mark.parametrize(
    ("prose", "part"),
    [
        ("the $h^2K$ term", "<msup><mi>h</mi><mn>2</mn></msup><mi>K</mi>"),
        (r"$2\sqrt{I/k_p}$", "<msqrt>"),
        (r"$h < 2I/c = 2 \times 0.05 / 20$", "<mo>&lt;</mo>"),
        ("$h &lt; 2$", "<mo>&lt;</mo>"),
        ("$a<b$ and <b>bold</b>", "<mi>a</mi><mo>&lt;</mo><mi>b</mi>"),
        ("$$x$$", '<math display="block">'),
        (r"\$5 and \$6", "$5 and $6"),
        ("between $5 and $6", "between $5 and $6"),
        ("<code>echo $PATH$HOME</code>", "<code>echo $PATH$HOME</code>"),
        ('<a href="https://x.org/$a$">$a$</a>', 'href="https://x.org/$a$"'),
        (r"$\frac{$ is a slip", "is a slip"),
    ],
)
def test_tex_becomes_mathml_where_it_is_text(prose: str, part: str) -> None:
    assert part in safe_html(prose)


@pytest.mark.parametrize(
    ("prose", "shown"),
    [
        ("at 2 ms, up to 5 % in 10 steps", "at 2_ms, up to 5_% in 10~steps"),
        ("is 2000 N m/rad and 5 N m s/rad.", "is 2000_N~m/rad and 5_N~m~s/rad."),
        ("about 0.5 kg m² here", "about 0.5_kg~m² here"),
        ("5 masses at 3 N mass", "5 masses at 3_N mass"),
        ("<b>at 2 ms</b>", "<b>at 2_ms</b>"),
        ("<code>sleep 2 s</code> for 2 s", "<code>sleep 2 s</code> for 2_s"),
        ("<pre>h < 2 s <b>3 s</b></pre>", "<pre>h &lt; 2 s <b>3 s</b></pre>"),
        ('<img alt="2 ms">', '<img alt="2 ms">'),
    ],
)
def test_no_line_ends_between_a_number_and_its_unit(prose: str, shown: str) -> None:
    assert safe_html(prose) == shown.replace("_", "\u202f").replace("~", "&nbsp;")


def test_a_unit_after_a_formula_stays_on_its_line_if_the_formula_ends_with_a_number() -> None:
    assert "</math>\u202fms" in safe_html("$h = 5$ ms")
    assert "</math>\u202fs" in safe_html("$10^{-3}$ s")
    assert "</math> s" in safe_html("$x$ s")


@pytest.mark.parametrize(
    ("tex", "rows", "cells"),
    [
        (r"\begin{aligned} a &= b \\ c &= d \end{aligned}", 2, 4),
        (r"\begin{gathered} a = 1 \\ b = 2 \end{gathered}", 2, 2),
        (r"\begin{dcases} a & x \\ b & y \end{dcases}", 2, 4),
    ],
)
def test_environments_that_the_library_does_not_know_are_shown_as_those_that_are_alike(
    tex: str, rows: int, cells: int
) -> None:
    shown = render_tex(tex)
    assert (shown.count("<mtr>"), shown.count("<mtd"), "&amp;" in shown) == (rows, cells, False)
    assert explain_tex(tex) is None


@pytest.mark.parametrize(
    ("tex", "why"),
    [
        (r"\begin{aligne} a \end{aligne}", "the environment 'aligne' is not known: did you mean align"),
        (r"\begin{foo} a \end{foo}", "the environment 'foo' is not known: write it with aligned, cases or matrix"),
        (r"\begin{aligned} a \end{align}", r"a \begin has no \end of the same name"),
        (r"\begin{pmatrix} a & b \end{pmatrix}", None),
    ],
)
def test_an_environment_that_is_not_shown_as_it_was_meant_is_remarked(tex: str, why: str | None) -> None:
    told = explain_tex(tex)
    assert told is None if why is None else told is not None and told.startswith(why)


def test_tex_that_cannot_be_read_is_shown_as_typed() -> None:
    assert safe_html(r"so $\sqrt$ here") == r"so <code>\sqrt</code> here"


@pytest.mark.parametrize(
    "prose",
    [
        "<script>alert(1)</script>",
        '<img src="x" onerror="alert(1)">',
        '<a href="javascript:alert(1)">x</a>',
        '<math><mi xlink:href="javascript:alert(1)" onclick="x">x</mi></math>',
        r"$\href{javascript:alert(1)}{x}$",
        r"$\style{background:url(x)}{a}$",
        r"$\text{<script>alert(1)</script>}$",
        "<math><mtext><table><mglyph><style><img src=x onerror=alert(1)></style></mglyph></table></mtext></math>",
        "<svg><script>alert(1)</script></svg>",
        "<code><script>alert(1)</script></code>",
        "<style>*{}</style><iframe src=x></iframe><form action=x><input name=y></form>",
    ],
)
def test_what_could_run_is_removed(prose: str) -> None:
    assert_harmless(safe_html(prose))


HOSTILE = st.sampled_from(
    [
        *(
            "<script>",
            "</script>",
            "<img src=x onerror=alert(1)>",
            "<a href='javascript:x'>",
            "<math>",
            "<mtext>",
            "<b",
        ),
        *(
            "$",
            "$$",
            r"\$",
            r"\href{javascript:x}{y}",
            r"\text{",
            r"\style{a}{b}",
            "{",
            "}",
            "^",
            "_",
            "&lt;",
            "&#x3c;",
        ),
        *(
            "<code>",
            "</code>",
            "<!--",
            "-->",
            "<svg onload=x>",
            " ",
            "x",
            "1",
            r"\frac",
            r"\begin{matrix}",
            '"',
            "'",
            ">",
        ),
    ]
)


@settings(max_examples=250)
@given(st.lists(HOSTILE | st.text(max_size=4), max_size=25).map("".join))
def test_no_text_gets_anything_through_that_could_run(prose: str) -> None:
    assert_harmless(safe_html(prose))


@settings(max_examples=100)
@given(st.text(alphabet="xyz01^_{}\\&<>+-=()[]|$ frac sqrt left right", max_size=40))
def test_no_tex_takes_the_page_down(tex: str) -> None:
    assert_harmless(safe_html(f"${tex}$"))


def test_a_label_is_plain_text() -> None:
    assert plain_text("Use <code>a &lt; b</code>") == "Use a < b"
    assert plain_text('<img src="a.png" alt=\'A &amp; B\'> <IMG alt="" src=x>') == "A & B"
    assert plain_text('<img src="a.png">') == ""
    asked = "<p>What is wrong here?</p><pre>for i in range(10)</pre>"
    assert plain_text(asked) == "What is wrong here? for i in range(10)"
    assert spoken_text("A servo of $k_p = 51.6$, $x_{1}$, $\\frac{1}{2}$") == "A servo of kp = 51.6, x1, $\\frac{1}{2}$"


def test_a_definition_cannot_blow_a_formula_up() -> None:
    bomb = r"\newcommand{\a}{" + "x" * 900 + "}" + r"\a" * 500
    assert safe_html(f"${bomb}$") == f"<code>{bomb}</code>"


def test_text_in_a_formula_holds_no_tags() -> None:
    assert "<mtext>&lt;b/a1&gt;</mtext>" in safe_html(r"$\text{<b/a1>}$")


def test_unclosed_elements_are_not_repeated_in_every_paragraph() -> None:
    text = "".join(f"<b a{i}>" for i in range(500)) + "<p>x" * 500
    assert len(safe_html(text)) < 20 * len(text)


@pytest.mark.parametrize(
    ("prose", "shown"),
    [
        ("a <b and c> d", "a <b> d</b>"),
        ("if a <b and c <d", "if a &lt;b and c &lt;d"),
        ("x <!-- y", "x &lt;!-- y"),
        ("x <!-- $y$ --> z", "x  z"),
        ("<code>$a$ and $b$", "<code><math"),
        ("<code>$a$</code> <CODE>$b$</CODE >", "<code>$a$</code> <code>$b$</code>"),
        ("<br/><mspace width='1em'/>", "<br>"),
    ],
)
def test_what_opens_no_tag_is_text(prose: str, shown: str) -> None:
    assert safe_html(prose).startswith(shown)


def test_tags_and_formulas_beyond_the_limits_are_shown_as_typed() -> None:
    assert safe_html("<i>x</i>" * TAGS_MAX).count("<i>") == TAGS_MAX / 2
    many = safe_html("$x$ " * TEX_BUDGET)
    assert 100 < many.count("<math") < TEX_BUDGET / 10
    assert "<code>x</code>" in many


def test_the_attributes_of_a_picture_are_read_from_its_text() -> None:
    text = '<p>Click: <img alt="An &lt;arm&gt;" src="/media/1/arm.png"/><img src="b.png"></p>'
    assert read_image(text) == {"alt": "An <arm>", "src": "/media/1/arm.png"}
    assert read_image("images/arm.png") == {}
