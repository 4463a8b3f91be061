"""Quizzes in Markdown: the same quiz both ways, and every mistake is told with its line and its cure."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from grader.domain.run import Limits
from grader.errors import Conflict, ContentError
from grader.grading.pipeline import Pipeline
from grader.library import load, load_files
from grader.library.conversion import convert_file, write_converted
from grader.library.markdown import read_markdown, write_markdown
from grader.library.question_text import find_name, find_question
from grader.library.scaffold import add_question, begin_quiz
from grader.questions import installed_kinds

ROOT = Path(__file__).parents[2]
SHIPPED = sorted([*(ROOT / "quizzes").glob("*.json"), *(ROOT / "tests").glob("**/quizzes/*.json")])
KINDS = sorted(set(installed_kinds()) - {"code"})

ONE = """---
id: 2-check
title: A check
---

## Periods {#period points=2}

How long is a *period* of $T = 2\\pi\\sqrt{L/g}$, with $L < 2$ m?

Answer: 2.006 s ± 0.01

### Explanation

It is $2\\pi\\sqrt{L/g}$.

## {#stage}

Which stage fills `data.xpos`?

- [x] Position stage
  > Poses follow from positions.
- [ ] Velocity stage
  > It reads poses.
"""


def read(text: str) -> Any:
    reading = read_markdown(text, "quizzes/2-check.md")
    assert reading.faults == ()
    return reading.raw


def told(text: str) -> list[str]:
    return [f"{fault.key}: {fault.why}" for fault in read_markdown(text, "quizzes/2-check.md").faults]


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_quiz_is_the_same_after_both_ways(file: Path) -> None:
    quiz = json.loads(file.read_text())
    written = write_markdown(quiz)
    assert read(written) == quiz
    assert write_markdown(read(written)) == written


def test_markdown_is_the_json_that_one_expects() -> None:
    assert read(ONE) == {
        "id": "2-check", "title": "A check", "questions": [
            {"id": "period", "kind": "numeric", "title": "Periods", "points": 2, "answer": 2.006, "unit": "s",
             "tol": 0.01, "q": "How long is a <em>period</em> of $T = 2\\pi\\sqrt{L/g}$, with $L < 2$ m?",
             "explain": "<p>It is $2\\pi\\sqrt{L/g}$.</p>"},
            {"id": "stage", "kind": "mcq", "q": "Which stage fills <code>data.xpos</code>?", "answer": 0,
             "options": ["Position stage", "Velocity stage"],
             "whys": ["Poses follow from positions.", "It reads poses."]},
        ],
    }  # fmt: skip


TRICKY = [
    "<p>a</p><p>b</p>", "<code>x</code> < 2", "$a_1*b_2$", "- [x] a", "## a", "Answer: 5", "a | b", "# ", "```", " a ",
    "1. a", "<ul><li>a</li></ul>", "&lt;", "a\nb", "a\r\nb", "{#q1}", "---", "> a", "\\", "*", "[x]: y", "\t", "\0",
    "$5",
]  # fmt: skip
texts = st.text(max_size=30) | st.sampled_from(TRICKY)
floats = st.floats(allow_nan=False, allow_infinity=False)
values = st.none() | st.booleans() | st.integers(-(2**60), 2**60) | floats | texts
anything = st.recursive(values, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3))
several = st.lists(texts, max_size=4)
keys = {
    "id": texts, "title": texts, "kind": st.sampled_from(KINDS) | texts, "q": texts, "explain": texts, "points": values,
    "reference": texts, "options": several, "whys": several, "items": several, "extra": several, "unit": values,
    "answer": values | st.lists(st.integers(0, 3), max_size=4), "tol": values, "sim": anything, "verify": anything,
    "pairs": st.lists(st.lists(texts, max_size=3), max_size=3), "check": anything, "label": values, "x-note": anything,
}  # fmt: skip
questions = st.sets(st.sampled_from([*keys]), min_size=1).flatmap(
    lambda names: st.fixed_dictionaries({"kind": keys["kind"]} | {name: keys[name] for name in sorted(names)})
)


PAIRS = {"kind": "match", "pairs": [["a|b", "\\|"], ["", "x"]], "extra": ["y"], "q": "|"}
labs = st.lists(st.dictionaries(texts, anything, max_size=3), min_size=1, max_size=2)
heads = st.fixed_dictionaries({"id": texts, "title": texts}, optional={"policy": anything, "labs": labs})


@given(heads, st.lists(questions, min_size=1, max_size=3))
@example({"id": "", "title": "---\n"}, [{"kind": "order", "items": ["a", "1. b", ""], "q": "1. a\n2. b"}])
@example({"id": "1.3", "title": "yes"}, [PAIRS])
def test_whatever_json_holds_comes_back(head: dict[str, Any], asked: list[dict[str, Any]]) -> None:
    quiz = {**head, "questions": asked}
    reading = read_markdown(write_markdown(quiz), "quizzes/any.md")
    assert reading.faults == ()
    assert json.dumps(reading.raw, sort_keys=True) == json.dumps(quiz, sort_keys=True) or reading.raw == quiz


@given(st.text(max_size=200) | st.lists(texts | st.sampled_from(ONE.splitlines()), max_size=20).map("\n".join))
@example("---\n&a [*a]\n---\n")
@example("---\n" + "[" * 3000 + "\n---\n")
@example("## a\n" + "> " * 3000 + "a")
@example("## a\n" + "- " * 500 + "[x] a")
@example("## {points=" + "9" * 5000 + "}\n")
@example("---\na: " + "9" * 5000 + "\n---\n")
@example("## \n```json question\n" + '{"a":' * 3000 + "\n```")
def test_no_text_raises(text: str) -> None:
    reading = read_markdown(text, "quizzes/any.md")
    assert (reading.raw is None) == bool(reading.faults)
    assert all(fault.key.startswith(("line ", "whole file")) for fault in reading.faults)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (("[x] Position", "[ ] Position"), "line 20: stage, no option is right: mark one with [x]"),
        (("[ ] Velocity", "Velocity"), "line 22: stage, option 2 has no mark: begin it with [ ] or"),
        (("  > It reads poses.\n", ""), "line 20: stage, option 2 has no sentence on it: write > and why below it"),
        (("Answer: 2.006 s ± 0.01", "Answer: about two"), "line 10: period, 'about two' is no number"),
        (("± 0.01", "± 1 %"), "line 10: period, '1 %' is no tolerance"),
        (("± 0.01\n", "± 0.01\nor so\n"), "line 10: period, the answer goes on in the next line"),
        (("{#period points=2}", "{period, 2 points}"), "line 6: q1, 'period, 2 points' in the braces is not read"),
        (("{#period points=2}", '{#period draw={"a": [1, 2]}}'), "line 6: q1, the braces are not read"),
        (("{#period points=2}", "{#period #other}"), "line 6: q1, id is given twice: keep one"),
        (("title: A check", "title: A check\ntitle: B"), "line 4: front matter: title occurs more than once"),
        (("title: A check", "title: [A"), "line 3: front matter:"),
        (("title: A check", "questions: []"), "line 1: front matter: questions stand below it: begin each with ##"),
        (("## Periods", "# Periods"), "line 6: a text before the first question"),
        (("### Explanation", "### Explanation\n\na\n\n### Explanation"), "Explanation occurs more than once"),
        (("Answer: 2.006 s ± 0.01", '```json verify\n{"by": }\n```'), "line 11, column 8: broken JSON"),
        (("Answer: 2.006 s ± 0.01", '```json verify\n[1]\n```'), "line 10: period, verify must be one JSON object"),
        (("Answer: 2.006 s ± 0.01", '```json question\n{"a": 1, "a": 2}\n```'), "a: occurs more than once: keep one"),
        (("Answer: 2.006 s ± 0.01", 'Answer: 1\n\n```json question\n{"answer": 2}\n```'), "answer is given twice"),
    ],
)  # fmt: skip
def test_a_mistake_of_form_is_told_with_its_line_and_cure(change: tuple[str, str], fault: str) -> None:
    assert change[0] in ONE
    assert any(fault in one for one in told(ONE.replace(*change))), told(ONE.replace(*change))


@pytest.mark.parametrize(
    ("change", "key", "why"),
    [
        (("{#stage}", "{#stage .predikt}"), "stage.kind", "line 16: "),
        (("points=2", "points=-2"), "period.points", "line 6: "),
        (("points=2", "pionts=2"), "period.pionts", "line 6: "),
        (("Velocity stage", "Position stage"), "stage.options", "line 20: "),
        (("It is $2\\pi", "It is $\\sqr{2}"), "period.explain", "line 12: "),
        (("title: A check", "title: 5"), "title", "line 1: "),
    ],
)
def test_a_mistake_of_content_is_told_with_its_line(
    tmp_path: Path, change: tuple[str, str], key: str, why: str
) -> None:
    (tmp_path / "quizzes").mkdir()
    (tmp_path / "quizzes/2-check.md").write_text(ONE.replace(*change))
    try:
        said = load(tmp_path).warnings
    except ContentError as error:
        said = error.faults
    assert any(fault.key.startswith(key) and fault.why.startswith(why) for fault in said), said


def test_a_course_in_markdown_is_checked_graded_and_archived(tmp_path: Path) -> None:
    begin_quiz(tmp_path, "2-check", "Check", as_markdown=True)
    for kind in KINDS:
        add_question(tmp_path, "2-check", kind)
    library = load(tmp_path)
    quiz = library.quiz("2-check")
    assert {question.kind for question in quiz.questions} == set(KINDS)
    assert library.file("2-check") == "quizzes/2-check.md"
    assert Pipeline(library).grade("2-check", "numeric", "2.23 s").points == 1
    assert load_files(library.sources["2-check"]).digest("2-check") == library.digest("2-check")


STARTER = """
## Double {#double}

Write `double(x)`.

```json exercise
{"entry": "double",
 "check": {"kind": "values", "program": "programs/double.py", "luck": 1,
           "functions": [{"results": [{"name": "twice"}]}], "cases": [{"id": "a", "arguments": [[1, 2]]}]}}
```

```python starter
def double(x):
    ...
```
"""


def exercise(tmp_path: Path, text: str = STARTER) -> Path:
    (tmp_path / "quizzes").mkdir()
    (tmp_path / "programs").mkdir()
    (tmp_path / "programs/double.py").write_text("def double(x):\n    return 2 * x\n")
    (tmp_path / "quizzes/2-check.md").write_text(f"---\ntitle: Check\n---\n{text}")
    return tmp_path / "quizzes/2-check.md"


def test_a_starter_may_stand_in_the_file(tmp_path: Path) -> None:
    file = exercise(tmp_path)
    library = load(tmp_path)
    assert library.starter(library.question("2-check", "double")) == "def double(x):\n    ...\n"
    again = load_files(library.sources["2-check"])
    assert again.starter(again.question("2-check", "double")) == "def double(x):\n    ...\n"
    assert Limits() == library.question("2-check", "double").limits  # type: ignore[attr-defined]
    quiz, starter = write_converted(file)
    assert (quiz.name, starter.read_text()) == ("2-check.json", "def double(x):\n    ...\n")
    as_json = load(tmp_path)
    assert as_json.starter(as_json.question("2-check", "double")) == "def double(x):\n    ...\n"
    with pytest.raises(Conflict, match="is there already"):
        file.write_text("---\ntitle: A\n---\n")
        write_converted(quiz)


def test_a_starter_with_another_function_is_a_fault(tmp_path: Path) -> None:
    exercise(tmp_path, STARTER.replace("def double(x):", "def dubble(x):"))
    with pytest.raises(ContentError, match=r"double\.starter: line 15: .* does not define 'double'"):
        load(tmp_path)


def test_two_files_of_one_quiz_are_a_fault_and_a_readme_is_none(tmp_path: Path) -> None:
    (tmp_path / "quizzes").mkdir()
    (tmp_path / "quizzes/README.md").write_text("# How we write")
    (tmp_path / "quizzes/2-check.md").write_text(ONE)
    [written] = convert_file(tmp_path / "quizzes/2-check.md").items()
    assert list(load(tmp_path).quizzes) == ["2-check"]
    written[0].write_text(written[1])
    with pytest.raises(ContentError, match="'2-check' is also the id of"):
        load(tmp_path)


def test_the_source_of_a_question_is_its_section() -> None:
    start, end = find_question(ONE, "stage", "quizzes/a.md")
    assert ONE[start:end].startswith("## {#stage}") and ONE[start:end].endswith("It reads poses.")
    assert find_name(ONE, start, "quizzes/a.md") == "stage"
