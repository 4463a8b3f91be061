"""The lesson's content, the real jail, and one submission graded through both."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from grader.domain.run import RunReport
from grader.domain.verdict import Verdict
from grader.exercises import judge_exercise, plan_exercise
from grader.exercises.running import runner
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.local_judging import judging_twice
from support.true_claims import telling_the_truth

ROOT = Path(__file__).parents[2]

Grade = Callable[..., Verdict]


def raise_again(error: Exception, kind: str) -> None:
    raise error


@pytest.fixture(autouse=True)
def twice(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Every script that is judged here is judged by the client's judges too, and told nothing untrue. What fails while
    its mistake is looked for is no verdict without a sentence here, but a failure."""
    monkeypatch.setattr(runner, "note_fault", raise_again)
    with judging_twice(), telling_the_truth():
        yield


def model_xml(name: str) -> str:
    return (ROOT / "models" / f"{name}.xml").read_text()


def question(id_: str) -> ScriptQuestion:
    quiz = json.loads((ROOT / "quizzes" / "1.3-exercises.json").read_text())
    return ScriptQuestion.model_validate(next(q for q in quiz["questions"] if q["id"] == id_))


def with_check(question: ScriptQuestion, **changes: Any) -> ScriptQuestion:
    """The same question with other parameters, as an author would write them."""
    raw = question.model_dump(mode="json")
    raw["check"] |= changes
    return ScriptQuestion.model_validate(raw)


@pytest.fixture(scope="module")
def jail() -> Iterator[Jail]:
    with Jail(ROOT / "models", workers=2) as jail:
        yield jail


@pytest.fixture(scope="module")
def run(jail: Jail) -> Callable[..., RunReport]:
    def run(question: ScriptQuestion, source: str, seed: int = 1) -> RunReport:
        plan = plan_exercise(question, model_xml, seed)
        return jail.run(plan.build_job(source, question.limits))

    return run


@pytest.fixture(scope="module")
def grade(run: Callable[..., RunReport]) -> Grade:
    def grade(question: ScriptQuestion, source: str, seed: int = 1) -> Verdict:
        report = run(question, source, seed)
        return judge_exercise(question, plan_exercise(question, model_xml, seed), report, source=source)

    return grade
