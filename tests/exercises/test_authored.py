"""Mistakes that an author names by a wrong script are told to every student whose script does the same."""

import json
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from exercises.conftest import ROOT, model_xml, question, with_check
from grader.domain.verdict import Verdict
from grader.errors import JailFault, NotFound
from grader.exercises import check_exercise, judge_exercise, plan_exercise
from grader.exercises.kind import ALIKE, agree
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail

SENTENCE = "The stability limit of damping is 2I/c: you have lost the factor of 2."

HALF = """
def largest_stable_timestep(model, integrator):
    body = model.jnt_bodyid[0]
    inertia = model.body_mass[body] * model.body_ipos[body, 2] ** 2 + model.body_inertia[body, 0]
    h = inertia / -model.actuator_biasprm[0, 2]
    return h - 1e-4, h + 1e-4
"""

ALSO_HALF = """
import mujoco
import numpy as np

def largest_stable_timestep(model, integrator):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, mass, np.ones(model.nv))
    return mass[0] / abs(model.actuator_biasprm[0, 2])
"""

NO_WEIGHTS = """
import mujoco

def rk4_step(model, data):
    h, start, speed = model.opt.timestep, data.qpos.copy(), data.qvel.copy()
    total, rate, slope = 0, speed, 0
    for share in (0.5, 0.5, 1.0, 0.0):
        mujoco.mj_forward(model, data)
        slope = data.qacc.copy()
        total = total + slope
        data.qpos[:] = start + share * h * data.qvel
        data.qvel[:] = speed + share * h * slope
    data.qpos[:] = start + h * speed
    data.qvel[:] = speed + h * total / 4
    data.time += h
"""

HELD = """
def control(model, data, target):
    return 90 * (0.5 - data.qpos[0]) - 12 * data.qvel[0] + data.qfrc_bias[0]
"""

ALSO_HELD = """
def control(model, data, target):
    error, rate = data.qpos[0] - 0.5, data.qvel[0]
    data.ctrl[0] = data.qfrc_bias[0] - 12 * rate - 90 * error
"""


def arm() -> ScriptQuestion:
    """The first exercise of lesson 3.1, with two episodes in the last case instead of ten."""
    question = json.loads((ROOT / "quizzes/3.1-exercises.json").read_text())["questions"][0]
    question["check"]["cases"][-1]["episodes"] = 2
    return ScriptQuestion.model_validate(question)


EXERCISES: Mapping[str, Callable[[], ScriptQuestion]] = {
    "threshold": lambda: question("servo-threshold"),
    "rk4": lambda: question("rk4-step"),
    "controller": arm,
}


def with_mistake(kind: str) -> ScriptQuestion:
    return with_check(EXERCISES[kind](), mistakes=[{"program": "programs/wrong.py", "sentence": SENTENCE}])


def grade(jail: Jail, asked: ScriptQuestion, wrong: str, source: str, *, seed: int = 3, run: Any = None) -> Verdict:
    plan = plan_exercise(asked, model_xml, seed, {"programs/wrong.py": wrong}.__getitem__)
    report = jail.run(plan.build_job(source, asked.limits))
    return judge_exercise(asked, plan, report, run or jail.run, source)


@pytest.mark.parametrize(
    ("kind", "wrong", "source"),
    [("threshold", HALF, ALSO_HALF), ("rk4", NO_WEIGHTS, NO_WEIGHTS.replace("total / 4", "0.25 * total")),
     ("controller", HELD, ALSO_HELD)],
)  # fmt: skip
def test_a_script_that_does_the_same_is_told_the_authors_sentence(
    jail: Jail, kind: str, wrong: str, source: str
) -> None:
    asked = with_mistake(kind)
    for seed in (3, 4):
        named = grade(jail, asked, wrong, source, seed=seed)
        assert named.diagnosis == SENTENCE
    before = grade(jail, EXERCISES[kind](), wrong, source)
    assert before.diagnosis != SENTENCE
    assert [finding.passed for finding in named.findings] == [finding.passed for finding in before.findings]
    assert named.points == before.points


@pytest.mark.parametrize(
    ("kind", "wrong", "source"),
    [("threshold", HALF, HALF.replace("inertia / -", "0.7 * inertia / -")),
     ("rk4", NO_WEIGHTS, NO_WEIGHTS.replace("total / 4", "total / 5")),
     ("controller", HELD, HELD.replace("0.5 -", "0.3 -"))],
)  # fmt: skip
def test_another_mistake_is_not(jail: Jail, kind: str, wrong: str, source: str) -> None:
    assert grade(jail, with_mistake(kind), wrong, source).diagnosis not in (None, SENTENCE)


def test_a_wrong_script_that_never_ends_or_a_broken_jail_changes_no_verdict(jail: Jail) -> None:
    asked = with_mistake("threshold")

    def fail(job: Any) -> Any:
        raise JailFault("none")

    for wrong, run in ((HALF, fail), ("import sys\nsys.exit()\n" + HALF, None), ("def largest(", None)):
        assert grade(jail, asked, wrong, ALSO_HALF, run=run).diagnosis not in (None, SENTENCE)


@pytest.mark.parametrize(
    ("text", "why"),
    [(None, "There is no programs/wrong.py"), ("def another(): pass", "defines no function largest_stable_timestep"),
     ("def largest(", "line 1"), ("\0", "wrong.py")],
)  # fmt: skip
def test_a_wrong_script_that_cannot_be_one_is_a_fault(text: str | None, why: str) -> None:
    def text_of(path: str) -> str:
        if text is None:
            raise NotFound(f"There is no {path}.")
        return text

    [fault] = check_exercise(with_mistake("threshold"), model_xml, "quizzes/q.json", text_of)
    assert fault.key == "servo-threshold.check.mistakes.0.program"
    assert why in fault.why


numbers = st.floats(allow_nan=False, allow_infinity=False, width=32)


@given(st.recursive(numbers | st.text(max_size=3) | st.none(), lambda inner: st.lists(inner, max_size=3)))
def test_what_is_measured_agrees_with_itself_and_with_its_round_off(value: Any) -> None:
    assert agree(value, value)
    assert agree({"a": value}, {"a": value}) and not agree({"a": value}, {"b": value})
    if isinstance(value, float) and abs(value) > 1e-30:
        assert agree(value, value * (1 + 0.5 * ALIKE)) and not agree(value, value * (1 + 2 * ALIKE))
