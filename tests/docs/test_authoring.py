"""docs/authoring.md names every key, and the content folder that it shows loads, its answer keys certified."""

import json
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
from grader.exercises import Case, Number, load_kinds, parameters
from grader.exercises.episodes import parameters as episodes
from grader.exercises.kinds.claims import parameters as claims
from grader.exercises.kinds.controller.parameters import ControllerParameters
from grader.exercises.kinds.policy.parameters import Normalisation, PolicyForm, PolicyParameters
from grader.exercises.kinds.rk4.parameters import OrderCheck, Rk4Case, Rk4Parameters, Start
from grader.exercises.kinds.threshold.parameters import ThresholdParameters
from grader.exercises.kinds.values import parameters as values
from grader.exercises.parameters import WrongProgram
from grader.expressions import fields
from grader.grading.pipeline import Pipeline
from grader.labs import build_lab_scene, run_lab
from grader.labs.kinds.integrators.comparison import run_integrators
from grader.labs.kinds.integrators.lab import IntegratorsLab
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
LABS: list[type[BaseModel]] = [lab.SimLab, IntegratorsLab, lab.Slider, lab.Select, lab.Button]
CHECKS: list[type[BaseModel]] = [ThresholdParameters, Rk4Parameters, Rk4Case, OrderCheck, Start, Number, Case]
CHECKS += [
    values.ValuesParameters,
    values.ValuesCase,
    values.Function,
    values.Result,
    values.Residual,
    parameters.Start,
]
CHECKS += [claims.ClaimsParameters, claims.ClaimsCase, claims.Claim, claims.Formula, claims.Axis]
CHECKS += [values.Array, values.Integer, WrongProgram]
CHECKS += [PolicyParameters, PolicyForm, Normalisation]
CHECKS += [ControllerParameters, episodes.EpisodesCase, episodes.Goal, episodes.TargetStep, episodes.Load]
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
    assert set(part.model_fields) - {"type", "template"} <= NAMED


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


TABLE = re.findall(r"^\| [^|]+ \| `(\w+)`[^|]* \| `(\{.*\})` \|$", PAGE, re.MULTILINE)
"""Which kind serves which sort of exercise: the kind, and the least that its `check` needs."""

PROGRAMS = {
    "programs/p.py": "def solve(x):\n    return x\n\n\ndef missed(q, x):\n    return q - x\n",
    "programs/targets.py": "def arguments(model, numbers, rng):\n    return (rng.uniform(-1, 1, 2),)\n",
    "solutions/m.xml": "<mujoco><worldbody><body name='arm'><geom size='.1' mass='1'/></body></worldbody></mujoco>",
}


def test_the_table_of_exercises_has_every_kind_and_each_of_its_examples_loads(tmp_path: Path) -> None:
    assert {name for name, _ in TABLE} == set(load_kinds())
    questions = []
    for index, (name, text) in enumerate(TABLE):
        check = json.loads(text)
        assert check["kind"] == name
        takes = load_kinds()[name].takes[0]
        model = {} if name in ("values", "model") else {"model": "sled" if "observe" in check else "cart"}
        asked = {"kind": "code", "id": f"e{index}", "q": "?", "takes": takes, "check": check | model}
        questions.append(asked | ({"entry": "solve"} if takes == "python" else {}))
    models = {path: body for path, body in FILES if path.startswith("models/")}
    quiz = json.dumps({"id": "1.1-table", "title": "The table", "questions": questions})
    for path, body in {**PROGRAMS, **models, "quizzes/1.1-table.json": quiz}.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(body)
    assert len(load(tmp_path).quiz("1.1-table").questions) == len(TABLE) >= len(load_kinds())


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
    assert [certificate.why for certificate in certified if not certificate.ok or certificate.remarks] == []
    assert {certificate.method for certificate in certified} == {
        "stage",
        "threshold",
        "measurement",
        "expression",
        "outcome",
    }
    (cart, five) = library.quiz("2-labs").labs
    assert isinstance(cart, lab.SimLab) and isinstance(five, IntegratorsLab)
    heavy = run_lab(cart, library.model_xml("cart"), {"mass": 4.0, "force": 0.0}, [(0.5, "kick")])
    assert heavy.stable
    start = build_lab_scene(cart, library.model_xml("cart"), {"mass": 4.0}).start
    assert start.qpos.tolist() == [0.3], "the keyframe must outlive the constants that are derived again"
    assert all(run.steps == 500 for run in run_integrators(five, library.model_xml("cart")).runs)
