"""How an attempt compares with earlier ones: from what the learner sees of them alone."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.courses.rules.progress import ComparedAttempt, describe_progress
from grader.domain.verdict import Status

WEIGHTS = "Your weights are 1, 2, 2, 1 over 4: use 6."


def attempt(
    number: int, points: float, said: str | None = None, held: str = "", status: str = "incorrect"
) -> ComparedAttempt:
    findings = [{"id": one, "passed": one in held} for one in "abc"]
    return ComparedAttempt(number, {"status": status, "points": points, "diagnosis": said, "findings": findings})


def test_the_same_mistake_is_told_whatever_its_numbers_are() -> None:
    again = attempt(2, 0, WEIGHTS.replace("4", "3"))
    assert describe_progress([attempt(1, 0, WEIGHTS)], again) == "The same mistake as in attempt 1."


def test_a_mistake_that_is_back_is_told_with_the_attempt_without_it() -> None:
    earlier = [attempt(1, 0, WEIGHTS), attempt(2, 2, "Another one.", "ab")]
    assert describe_progress(earlier, attempt(3, 0, WEIGHTS)) == (
        "The mistake of attempt 1 is back: in attempt 2 it was gone, with 2 points. See what you changed there."
    )


def test_what_holds_now_is_praised_with_its_number() -> None:
    before, now = attempt(1, 1, "One.", "a"), attempt(2, 2.5, "Two.", "ab", "partial")
    assert describe_progress([before], now) == ("Better than attempt 1: 1 more of 3 holds, 2.5 points in place of 1.")
    assert describe_progress([now], attempt(3, 1, "Three.", "a")).startswith("Attempt 2 was better, 2.5 points")


@pytest.mark.parametrize("status", ["invalid_answer", "grader_fault", "needs_review"])
def test_what_says_nothing_about_the_work_is_not_compared(status: str) -> None:
    assert describe_progress([attempt(1, 0, WEIGHTS, status=status)], attempt(2, 0, WEIGHTS)) == ""
    assert describe_progress([attempt(1, 0, WEIGHTS)], attempt(2, 0, WEIGHTS, status=status)) == ""


VERDICTS: st.SearchStrategy[dict[str, Any]] = st.fixed_dictionaries(
    {
        "status": st.sampled_from([one.value for one in Status]),
        "points": st.sampled_from([0.0, 1.0, 2.0]),
        "diagnosis": st.sampled_from([None, WEIGHTS, "Another one."]),
        "findings": st.lists(st.fixed_dictionaries({"id": st.sampled_from("ab"), "passed": st.booleans()}), max_size=2),
    }
)


@given(st.lists(VERDICTS, max_size=5), VERDICTS)
def test_each_sentence_is_true(verdicts: list[dict[str, Any]], last: dict[str, Any]) -> None:
    earlier = [ComparedAttempt(index, verdict) for index, verdict in enumerate(verdicts, 1)]
    now = ComparedAttempt(len(earlier) + 1, last)
    said = describe_progress(earlier, now)
    if said.startswith("The same mistake"):
        assert earlier[int(said.rstrip(".").split()[-1]) - 1].verdict["diagnosis"] == last["diagnosis"]
    if "more of" in said or said.startswith("Better"):
        assert now.points > earlier[int(said.split()[3].strip(":,")) - 1].points
    if "was better" in said:
        assert earlier[int(said.split()[1]) - 1].points > now.points
