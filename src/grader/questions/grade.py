"""Read and grade the answers that need no jail, whatever the kind of the question."""

from typing import Any

from grader.domain.verdict import Status, Verdict
from grader.errors import InvalidAnswer
from grader.questions.question import Question
from grader.questions.registry import kind_of


def read_answer(question: Question, answer: Any) -> str:
    """Return the answer as it is understood, for the learner to confirm.

    Raises InvalidAnswer with one sentence: why the answer cannot be read, and what would be readable.
    """
    kind = kind_of(question)
    return kind.describe(question, kind.read(question, answer))


def grade_answer(question: Question, answer: Any) -> Verdict:
    """Grade any JSON value; one that cannot be read gets `invalid_answer` and the reason.

    Of a wrong answer only `explain`, and `expected` of a finding, may contain the right one.
    """
    kind = kind_of(question)
    try:
        given = kind.read(question, answer)
    except InvalidAnswer as error:
        return Verdict(status=Status.INVALID_ANSWER, points=0.0, max_points=question.points, diagnosis=str(error))
    told = {"read_as": kind.describe(question, given), "explain": question.explain}
    return kind.grade(question, given).model_copy(update=told)
