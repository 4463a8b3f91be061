"""The line and the statement that a diagnosis is about."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.domain.verdict import Span, Status, Verdict
from grader.grading.spans import find_span, locate_diagnosis

SOURCE = "import mujoco\n\ndef f(x):\n    é = 1; y = (x +\n         é)\n    while y:\n        y -= 1\n"


def verdict(said: str | None, line: int | None = None) -> Verdict:
    return Verdict(status=Status.INCORRECT, points=0.0, max_points=1.0, diagnosis=said, line=line)


@pytest.mark.parametrize(
    ("said", "line"),
    [
        ("NameError: name 'np' is not defined, in line 4 of your script", 4), ("Line 7 raised a ValueError", 7),
        ("It was slow. The loop in line 6 (while y:), in f(), never ends.", 6), ("In line 4", None), (None, None),
        ("SyntaxError: expected ':' (line 5: def f())", 5), ("IndentationError: unexpected indent (line 3: x)", 3),
        ("NameError, in line 99 of your script", None),
    ],
)  # fmt: skip
def test_the_line_that_a_sentence_names_is_that_of_the_verdict(said: str | None, line: int | None) -> None:
    assert locate_diagnosis(verdict(said), SOURCE).line == line


def test_the_line_of_a_mistake_comes_first_and_one_outside_the_script_is_dropped() -> None:
    assert locate_diagnosis(verdict("in line 4 of your script", 7), SOURCE).line == 7
    assert locate_diagnosis(verdict("", 99), SOURCE).line is None


def test_a_span_is_that_of_the_statement_in_characters() -> None:
    assert find_span(SOURCE, 5) == Span(line=4, column=11, end_line=5, end_column=11)
    assert find_span(SOURCE, 6) == Span(line=6, column=4, end_line=6, end_column=12)
    assert find_span(SOURCE, 2) is None
    assert find_span("def (", 1) is None
    bad = locate_diagnosis(verdict("SyntaxError: invalid syntax (line 2: def ()"), "\n  def (\n")
    assert bad.span == Span(line=2, column=2, end_line=2, end_column=7)


@given(st.text(max_size=80), st.integers(1, 5))
def test_whatever_the_script_nothing_is_raised(source: str, line: int) -> None:
    span = find_span(source, line)
    assert span is None or 1 <= span.line <= span.end_line
