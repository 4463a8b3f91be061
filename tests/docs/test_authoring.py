"""docs/authoring.md names every key, and the content folder that it shows loads, its answer keys certified."""

import re
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from grader.certify.keys import certify_quizzes
from grader.domain import lab
from grader.domain.policy import Late, Policy
from grader.domain.rubric import RubricItem, SecondMarking
from grader.domain.run import Limits
from grader.domain.verdict import Status
from grader.domain.verify import Claim, ServoJoint, Verify
from grader.exercises import Case, Number, load_kinds
from grader.exercises.kinds.controller import parameters as controller
from grader.exercises.kinds.rk4.parameters import OrderCheck, Rk4Case, Rk4Parameters, Start
from grader.exercises.kinds.threshold.parameters import ThresholdParameters
from grader.exercises.kinds.values import parameters as values
from grader.exercises.parameters import WrongProgram
from grader.expressions import fields
from grader.grading.pipeline import Pipeline
from grader.labs import build_lab_scene, run_integrators, run_lab
from grader.library import load
from grader.questions import Quiz
from grader.questions import installed_kinds as question_kinds

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/authoring.md").read_text(encoding="utf-8")
FILES = re.findall(r"^`([\w./-]+)`:\n\n```\w+\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
NAMED = set(re.findall(r"`([A-Za-z_0-9]+)`", PAGE))
WAYS = get_args(get_args(Verify)[0])
OURS = {name: kind for name, kind in question_kinds().items() if type(kind).__module__.startswith("grader.")}
"""The kinds of question of this repository: another package documents its own."""

QUESTIONS = [*dict.fromkeys(kind.question for kind in OURS.values())]
LABS: list[type[BaseModel]] = [lab.SimLab, lab.IntegratorsLab, lab.Slider, lab.Select, lab.Button]
CHECKS: list[type[BaseModel]] = [ThresholdParameters, Rk4Parameters, Rk4Case, OrderCheck, Start, Number, Case]
CHECKS += [values.ValuesParameters, values.ValuesCase, values.Function, values.Result, values.Residual, values.Start]
CHECKS += [values.Array, values.Integer, WrongProgram]
CHECKS += [controller.ControllerParameters, controller.ControllerCase, controller.Goal]
CHECKS += [controller.TargetStep, controller.Load]
RULES: list[type[BaseModel]] = [Policy, Late, RubricItem, SecondMarking]
PARTS: list[type[BaseModel]] = [
    *WAYS,
    ServoJoint,
    Claim,
    *QUESTIONS,
    *RULES,
    Limits,
    *LABS,
    lab.Readout,
    lab.Plot,
    lab.PlotTrace,
    *CHECKS,
]


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.__name__)
def test_every_key_is_named(part: type[BaseModel]) -> None:
    assert set(part.model_fields) - {"type"} <= NAMED


def test_every_rule_of_a_quiz_is_named() -> None:
    assert {field.alias or name for name, field in Quiz.model_fields.items()} - {
        "id",
        "title",
        "questions",
        "labs",
    } <= NAMED


@pytest.mark.parametrize("key", ["counts", "feedback", "solutions"])
def test_every_choice_of_a_policy_is_named_and_its_default_first(key: str) -> None:
    field = Policy.model_fields[key]
    (row,) = re.findall(rf"^\| `{key}` \| (.*) \|$", PAGE, re.MULTILINE)
    named = [word for word in re.findall(r"`(\w+)`", row) if word != "explain"]
    assert set(named) == set(get_args(field.annotation))
    assert named[0] == field.default


def test_every_field_that_a_verify_may_fill_or_set_is_named() -> None:
    allowed = fields.DATA_RESULTS | fields.DATA_STATE | fields.MODEL_PARAMETERS
    assert allowed | set(fields.OPTION_SCALARS) | fields.OPTION_VECTORS <= NAMED


def test_every_kind_of_check_has_its_section() -> None:
    assert set(re.findall(r'^### `"kind": "(\w+)"`', PAGE, re.MULTILINE)) == set(load_kinds())


@pytest.mark.slow
def test_the_content_folder_of_the_page_loads_and_its_keys_are_certified(tmp_path: Path) -> None:
    assert len(FILES) == PAGE.count("\n```") / 2
    for name, text in FILES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    library = load(tmp_path)
    assert library.warnings == ()
    assert library.quiz("2-graded").default_policy.late is not None
    assert Pipeline(library).grade("2.1-check", "q1", "2.006 s").status is Status.CORRECT
    questions = [question for quiz in library.quizzes.values() for question in quiz.questions]
    assert {question.kind for question in questions} >= {*OURS} - {"debug"}
    keyed = [one for one in certify_quizzes(library, library.quizzes) if one.key.verify]
    certified = [one.certificate for one in keyed if one.certificate is not None]
    assert [one.why for one in certified if not one.ok or one.remarks] == []
    assert {one.method for one in certified} == {"stage", "threshold", "measurement", "expression", "outcome"}
    (cart, five) = library.quiz("2-labs").labs
    assert isinstance(cart, lab.SimLab) and isinstance(five, lab.IntegratorsLab)
    heavy = run_lab(cart, library.model_xml("cart"), {"mass": 4.0, "force": 0.0}, [(0.5, "kick")])
    assert heavy.stable
    start = build_lab_scene(cart, library.model_xml("cart"), {"mass": 4.0}).start
    assert start.qpos.tolist() == [0.3], "the keyframe must outlive the constants that are derived again"
    assert all(run.steps == 500 for run in run_integrators(five, library.model_xml("cart")).runs)
