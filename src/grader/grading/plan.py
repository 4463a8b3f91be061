"""Plan and Checker: what every kind of exercise provides."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Generic, Protocol, TypeVar

from grader.domain.quiz import CodeQuestion
from grader.domain.run import RunReport
from grader.domain.verdict import Verdict
from grader.errors import Fault

ModelXml = Callable[[str], str]
"""The MJCF text of a model of the content folder by its name; raises GraderError where there is none."""

Problem = TypeVar("Problem")


@dataclass(frozen=True)
class Plan(Generic[Problem]):
    """What runs in the jail (`driver` over plain-JSON `inputs`), and what only the judge may know (`problem`)."""

    driver: str
    inputs: Mapping[str, Any]
    problem: Problem


class Checker(Protocol[Problem]):
    """One kind of exercise."""

    def faults(self, question: CodeQuestion, model_xml: ModelXml, where: str) -> list[Fault]:
        """Everything that is wrong with the question's `check`; `where` is the quiz file's name."""

    def plan(self, question: CodeQuestion, model_xml: ModelXml, seed: int) -> Plan[Problem]:
        """The cases of one submission; the same seed gives the same plan."""

    def judge(self, question: CodeQuestion, plan: Plan[Problem], report: RunReport) -> Verdict:
        """The verdict on a script that returned; reads only plain arrays and simulates the cases again."""


def driver_text(name: str) -> str:
    """The source of a driver of grading/drivers."""
    return (files("grader.grading") / "drivers" / f"{name}.py").read_text()
