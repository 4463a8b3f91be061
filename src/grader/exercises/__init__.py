"""Exercises: scripts that are run in the jail and judged by simulating again, each of a kind that is a plug-in. Other
rooms import from here alone. A kind of exercise subclasses `Kind`; docs/authoring.md says what an author writes."""

from grader.domain.axes import ClassAxis, Placed, Position
from grader.domain.numbers import NotNegative, Points, Positive, Range, Real, Value
from grader.domain.progress import TrialProgress
from grader.domain.run import ChannelClosed, Limits, MalformedAnswer
from grader.exercises.film import Film, Panel
from grader.exercises.kind import (
    Ask,
    DrawnCase,
    ExerciseExample,
    Intervals,
    JudgedTrial,
    Judgement,
    Kind,
    LazyAnswer,
    Measurement,
    Mistake,
    Part,
    Results,
    TextOf,
    Trial,
)
from grader.exercises.luck import compute_chance_of_luck
from grader.exercises.parameters import Case, ExerciseParameters, Number, Start, Strict, WrongParameter, draw_number
from grader.exercises.rehearsing import certify_exercise, check_exercise
from grader.exercises.running.authored import write_wrong_scripts
from grader.exercises.running.lazy import STARTER, write_lazy_answers
from grader.exercises.running.planning import (
    GROUP,
    Plan,
    find_placing,
    list_codes,
    load_kinds,
    plan_exercise,
    prepare_exercise,
    save_hidden_models,
)
from grader.exercises.running.program_calls import use_jail
from grader.exercises.running.progress import Progress, Tell
from grader.exercises.running.runner import judge_exercise
from grader.exercises.visible import describe_exercise, list_visible_models
from grader.numerics.scene import Scene
from grader.numerics.shares import bound_share

__all__ = [
    "GROUP",
    "STARTER",
    "Ask",
    "Case",
    "ChannelClosed",
    "ClassAxis",
    "DrawnCase",
    "ExerciseExample",
    "ExerciseParameters",
    "Film",
    "Intervals",
    "JudgedTrial",
    "Judgement",
    "Kind",
    "LazyAnswer",
    "Limits",
    "MalformedAnswer",
    "Measurement",
    "Mistake",
    "NotNegative",
    "Number",
    "Panel",
    "Part",
    "Placed",
    "Plan",
    "Points",
    "Position",
    "Positive",
    "Progress",
    "Range",
    "Real",
    "Results",
    "Scene",
    "Start",
    "Strict",
    "Tell",
    "TextOf",
    "Trial",
    "TrialProgress",
    "Value",
    "WrongParameter",
    "bound_share",
    "certify_exercise",
    "check_exercise",
    "compute_chance_of_luck",
    "describe_exercise",
    "draw_number",
    "find_placing",
    "judge_exercise",
    "list_codes",
    "list_visible_models",
    "load_kinds",
    "plan_exercise",
    "prepare_exercise",
    "save_hidden_models",
    "use_jail",
    "write_lazy_answers",
    "write_wrong_scripts",
]  # fmt: skip
