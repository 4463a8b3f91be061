"""Exercises: scripts that are run in the jail and judged by simulating again, each of a kind that is a plug-in.

Other rooms import from here alone. A kind of exercise subclasses `Kind`; docs/authoring.md says what an author writes.
"""

from grader.exercises.kind import (
    DrawnCase,
    Intervals,
    Judged,
    Judgement,
    Kind,
    LazyAnswer,
    Results,
    TextOf,
    Trial,
)
from grader.exercises.luck import chance_of_luck
from grader.exercises.parameters import Case, ExerciseParameters, Number, Strict, Value, WrongParameter, drawn
from grader.exercises.progress import Progress, Tell
from grader.exercises.runner import (
    GROUP,
    Plan,
    check_exercise,
    installed_kinds,
    judge_exercise,
    lazy_answers,
    plan_exercise,
    prepare_exercise,
)

__all__ = [
    "GROUP",
    "Case",
    "DrawnCase",
    "ExerciseParameters",
    "Intervals",
    "Judged",
    "Judgement",
    "Kind",
    "LazyAnswer",
    "Number",
    "Plan",
    "Progress",
    "Results",
    "Strict",
    "Tell",
    "TextOf",
    "Trial",
    "Value",
    "WrongParameter",
    "chance_of_luck",
    "check_exercise",
    "drawn",
    "installed_kinds",
    "judge_exercise",
    "lazy_answers",
    "plan_exercise",
    "prepare_exercise",
]
