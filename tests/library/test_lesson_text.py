"""The text of a lesson: what is read of its Markdown, and what `grader check` says of its faults."""

import json
from pathlib import Path

import pytest

from grader.errors import ContentError
from grader.library import Library, load
from grader.library.lesson_text import Heading, Placement, Prose

XML = '<mujoco><worldbody><body name="ball"><freejoint/><geom name="ball" size="1"/></body></worldbody></mujoco>'
MCQ = {"kind": "mcq", "q": "Which?", "options": ["a", "b"], "answer": 1, "whys": ["a is not.", "b is."]}
LAB = {"id": "fall", "kind": "simlab", "title": "A fall", "model": "ball"}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A content folder with a quiz and a lab of lesson 2, and a quiz of lesson 3."""
    for folder in ("quizzes", "models", "lessons"):
        (tmp_path / folder).mkdir()
    (tmp_path / "models" / "ball.xml").write_text(XML)
    for name, more in (("2-check", {"labs": [LAB]}), ("3-check", {})):
        quiz = {"id": name, "title": "A quiz", "questions": [MCQ], **more}
        (tmp_path / "quizzes" / f"{name}.json").write_text(json.dumps(quiz))
    return tmp_path


def read(root: Path, *lines: str, name: str = "2") -> Library:
    (root / "lessons" / f"{name}.md").write_text("\n".join(lines), encoding="utf-8")
    return load(root)


def test_the_parts_of_a_lesson_stand_in_the_order_of_its_text(root: Path) -> None:
    library = read(
        root, "# Falling *bodies*", "", "Height $a_b * c_d$ costs 5 $.", "", "- one", "", "## Try `it`", "",
        "```lab 2-check/fall", "```", "", "## Try it", "", "```quiz 2-check", "```", "", "```python",
        "x = '$y$'", "```",
    )  # fmt: skip
    lesson = library.lessons["2"]
    assert library.warnings == ()
    assert lesson.title == "Falling <em>bodies</em>"
    prose, *rest, code = lesson.parts
    assert isinstance(prose, Prose)
    assert [block.strip() for block in prose.blocks] == [
        "<p>Height $a_b * c_d$ costs 5 &#36;.</p>",
        "<ul>\n<li>one</li>\n</ul>",
    ]
    assert rest == [
        Heading(2, "try-it", "Try <code>it</code>"), Placement("2-check", "fall"), Heading(2, "try-it-2", "Try it"),
        Placement("2-check"),
    ]  # fmt: skip
    assert isinstance(code, Prose)
    assert "x = '$y$'" in code.blocks[0]


@pytest.mark.parametrize(
    ("lines", "line", "why"),
    [
        (["Text alone"], 1, "has no title"),
        (["## Below"], 1, "the first heading must be the title"),
        (["# A", "# B"], 2, "a lesson has one title"),
        (["# A", "### C"], 2, "begin it with ##"),
        (["# A", "", "```quiz 2-chek", "```"], 3, 'there is no quiz "2-chek"'),
        (["# A", "", "```quiz 3-check", "```"], 3, "is of lesson 3"),
        (["# A", "```lab 2-check/rise", "```"], 2, "is no lab"),
        (["# A", "```quiz 2-check/fall", "```"], 2, "is no quiz"),
        (["# A", "```quiz", '{"kind": "mcq"}', "```"], 2, "must name one quiz and hold nothing"),
        (["# A", "```quiz 2-check", "```", "```quiz 2-check", "```"], 4, "is placed twice"),
        (["# A", "", "see [below](#below)", "", "## Above"], 3, "the anchors are: #above"),
        (["# A", "see [it](../secret.md)"], 2, "leads nowhere"),
        (["# A", "> ## B"], 2, "take it out"),
    ],
)
def test_a_fault_names_file_line_and_cure(root: Path, lines: list[str], line: int, why: str) -> None:
    with pytest.raises(ContentError) as error:
        read(root, *lines)
    first = error.value.faults[0]
    assert (first.file, first.key) == ("lessons/2.md", f"line {line}")
    assert why in " ".join(fault.why for fault in error.value.faults)


def test_a_lesson_may_be_text_alone_but_must_have_a_number(root: Path) -> None:
    assert read(root, "# A", name="7").lessons["7"].title == "A"
    with pytest.raises(ContentError, match="'seven' is no lesson: name the file by its number"):
        read(root, "# A", name="seven")


def test_a_formula_of_several_lines_and_one_between_brackets_are_formulas(root: Path) -> None:
    lesson = read(root, "# A", "$$", "a_1 < b", "= c", "$$", r"so \(x_1 * y_1\) is \[z\]", "> [!tip] Mind it", "> more",
                  "", "```output", "1 < 2", "```").lessons["2"]  # fmt: skip
    (prose,) = lesson.parts
    assert isinstance(prose, Prose)
    assert [block.strip() for block in prose.blocks] == [
        "<p>$$a_1 &lt; b = c$$</p>",
        "<p>so $x_1 * y_1$ is $$z$$</p>",
        "<blockquote>\n<p><strong>Mind it</strong><br />\nmore</p>\n</blockquote>",
        "<pre><samp>1 &lt; 2\n</samp></pre>",
    ]


def test_pictures_and_their_descriptions_that_are_missing_are_remarks(root: Path) -> None:
    remarks = read(root, "# A", "![A rod](rod.png)", "", "![](https://example.org/rod.png)").warnings
    assert [(remark.key, remark.why.partition(":")[0]) for remark in remarks] == [
        ("line 2", 'the picture "rod.png" is not there'),
        ("line 4", 'the picture "rod.png" has no description'),
    ]


def test_tex_that_cannot_be_read_is_a_remark_with_its_line(root: Path) -> None:
    (remark,) = read(root, "# A", "", "Fine.", "", r"The root $\sqr{2}$").warnings
    assert (remark.file, remark.key) == ("lessons/2.md", "line 5")
