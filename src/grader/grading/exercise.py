"""Exercises: which checker judges a code question, and the verdict on a script that did not return."""

from typing import Any

from grader.domain.quiz import CodeQuestion
from grader.domain.run import RunReport, RunStatus
from grader.domain.verdict import Status, Verdict
from grader.errors import Fault
from grader.grading.plan import Checker, ModelXml, Plan
from grader.grading.rk4.checker import Rk4Checker
from grader.grading.threshold.checker import ThresholdChecker

CHECKERS: dict[str, Checker[Any]] = {"rk4": Rk4Checker(), "threshold": ThresholdChecker()}
"""By the name that stands in `check.kind`."""


def check_exercise(question: CodeQuestion, model_xml: ModelXml, where: str) -> list[Fault]:
    """Every fault of the question's `check`, all at once; `where` is the quiz file's name."""
    checker = CHECKERS.get(question.check.kind)
    if checker is None:
        known = ", ".join(sorted(CHECKERS))
        return [Fault(where, f"{question.id}.check.kind", f"no checker is called {question.check.kind!r}; use {known}")]
    return checker.faults(question, model_xml, where)


def plan_exercise(question: CodeQuestion, model_xml: ModelXml, seed: int) -> Plan[Any]:
    """What to run in the jail, and what to judge it by; `seed` draws the hidden cases."""
    return CHECKERS[question.check.kind].plan(question, model_xml, seed)


def judge_exercise(question: CodeQuestion, plan: Plan[Any], report: RunReport) -> Verdict:
    """The verdict; a script that did not return gets the status of that name, with the reason.

    The explanation of an exercise names its results, so it comes with full marks only.
    """
    if report.status is not RunStatus.RETURNED:
        return Verdict(
            status=Status(report.status.value), points=0.0, max_points=question.points, diagnosis=report.reason or None
        )
    verdict = CHECKERS[question.check.kind].judge(question, plan, report)
    return verdict.model_copy(update={"explain": question.explain}) if verdict.status is Status.CORRECT else verdict
