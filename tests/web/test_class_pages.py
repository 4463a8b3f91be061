"""What the pages of a class offer at a question, without a browser."""

import pytest

from grader.courses.reporting.class_answers import ClassAnswers
from grader.domain.axes import RIGHT, ClassAxis
from grader.errors import NotFound
from grader.web.cohort.answers_page import ClassAt
from grader.web.cohort.axis_words import describe_right, write_value
from grader.web.cohort.scripts_page import find_family
from support.content import load_content


@pytest.mark.parametrize(
    ("quiz", "question", "shows"),
    [
        ("1.3-exercises", "rk4-step", True),
        ("4.1-exercises", "cart", True),
        ("5.1-exercises", "drone-policy", False),
        ("1.3-check", "q1", False),
    ],
)
def test_scripts_and_models_are_read_side_by_side_and_files_are_not(quiz: str, question: str, *, shows: bool) -> None:
    asked = load_content().question(quiz, question)
    at = ClassAt(quiz, asked, ClassAnswers((), {}), (), "A title")
    assert at.shows_scripts is shows
    with pytest.raises(NotFound, match="any more" if shows else "are no scripts"):
        find_family(at, "key")


def test_what_is_right_is_said_in_whole_words() -> None:
    goals = ClassAxis("goals", "Goals met", "goals", (2, float("inf")), line="all 2", is_whole=True)
    assert [write_value(number, goals).split()[-1] for number in (1.0, 2.0)] == ["goal", "goals"]
    drawn = ClassAxis("n0", "The answer", "times the right number", (0.9, 1.1), line=RIGHT)
    assert describe_right(drawn) == "each learner has a right number of their own"
