"""What a page does not show as its author meant is remarked on; what it shows is not."""

import pytest

from grader.library.checking.prose_remarks import list_prose_remarks


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (r"$\sqr{2}$", r"did you mean \sqrt?"),
        (r"$\omgea_n$", r"did you mean \omega?"),
        (r"$\frac{1}{2$", "a { has no }"),
        ("$x^$", "this TeX cannot be read"),
        ("costs $5", "an odd number of $ signs"),
        ("<cod>x</cod>", "did you mean <code>?"),
        ("<centre>x</centre>", "<centre> is not shown"),
        ("<code>a", "add </code>"),
        ("<b><i>x</b>", "add </i> before </b>"),
        ("a</b>", "closes nothing"),
        ('<img src="a.png" alt="">', 'the picture "a.png" is not there'),
        ('<img src="https://example.org/a.png">', 'the picture "a.png" has no description'),
        ("<b style='color:red'>x</b>", "the attribute style"),
        ("a **b** c", "write <b>b</b>"),
        ("read `data.x`", "write <code>data.x</code>"),
        ("[the page](https://example.org)", '<a href="https://example.org">'),
        ("# Title", "write <h3>"),
        ("see\n- one\n- two", "write <ul>"),
    ],
)
def test_a_mistake_is_told_with_its_cure(text: str, part: str) -> None:
    [remark] = list_prose_remarks(text)
    assert part in remark


@pytest.mark.parametrize(
    "text",
    [
        "<p>one<p>two",
        "<ul><li>a<li>b</ul>",
        "2 < 3 and a*b*c, x__init__y",
        "<code>**x** `y` $5 $ [1](http://x)</code>",
        r"$\mathrm{d}x$ $\mathbf{M}(q)\ddot{q}$ $$\int_0^1 x^2 \, dx$$ \$5",
        "$a<b$ and <b>c</b>",
        '<img src="https://example.org/a.png" alt="a"><br><hr/>',
        '<a href="https://example.org/$a$">x</a>',
        "<math><mi>x</mi></math>",
        "<!-- <nothing> **x** -->",
    ],
)
def test_what_is_shown_is_not_remarked_on(text: str) -> None:
    assert [*list_prose_remarks(text)] == []
