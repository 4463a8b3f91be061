"""Models that reach the jail compiled are those that it would compile itself."""

from collections.abc import Callable
from dataclasses import replace

import mujoco
import pytest

from exercises.conftest import Grade, model_xml, question
from grader.domain.run import RunReport, RunStatus
from grader.domain.verdict import Status
from grader.exercises import judge_exercise, plan_exercise, save_hidden_models
from grader.exercises.driving import harness
from grader.sandbox.jail import Jail

pytestmark = pytest.mark.jail

SERVO = question("servo-threshold")

SAYING = """
import hashlib
import mujoco
import numpy as np

def largest_stable_timestep(model, integrator):
    saved = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, saved)
    digest = hashlib.sha256(saved.tobytes()).digest()
    model.opt.timestep = 1
    return int.from_bytes(digest[:6], "little"), int.from_bytes(digest[6:12], "little")
"""
"""Returns what it is given, as a claim."""

WRITING = """
import mujoco
from pathlib import Path

def largest_stable_timestep(model, integrator):
    model.actuator_gainprm[0, 0] = 123.0
    mujoco.mj_saveLastXML("model.xml", model)
    text = Path("model.xml").read_text()
    own = mujoco.MjModel.from_xml_string(text)
    print("123" in text, own.body_mass[1] == model.body_mass[1], own.njnt)
"""


def test_a_model_is_the_same_whether_the_jail_loads_or_compiles_it(jail: Jail) -> None:
    plan = plan_exercise(SERVO, model_xml, 7)
    job = plan.build_job(SAYING, SERVO.limits)
    late = save_hidden_models(SERVO, plan)
    loaded = jail.run(replace(job, late_inputs=lambda: late))
    compiled = jail.run(replace(job, inputs={**job.inputs, "models": {}}))
    for report in (loaded, compiled):
        assert report.status is RunStatus.RETURNED
    said = [{**report.results, **report.hidden_results} for report in (loaded, compiled)]
    names = [f"t{index}_claim" for index in range(len(plan.trials))]
    assert [said[0][name].tolist() for name in names] == [said[1][name].tolist() for name in names]
    assert len({tuple(said[0][name].tolist()) for name in names}) == 7  # of 21 calls: one model a case


def test_a_script_that_saves_the_text_of_a_model_gets_it(run: Callable[..., RunReport]) -> None:
    report = run(SERVO, WRITING)
    assert report.status is RunStatus.RETURNED
    assert report.stdout.splitlines() == ["True True 1"] * 3


def test_a_verdict_is_the_same_with_models_that_are_sent_late(jail: Jail, grade: Grade) -> None:
    source = "def largest_stable_timestep(model, integrator):\n    return (0.0198, 0.0202)\n"
    plan = plan_exercise(SERVO, model_xml, 3)
    job = plan.build_job(source, SERVO.limits)
    verdict = judge_exercise(SERVO, plan, jail.run(replace(job, late_inputs=lambda: save_hidden_models(SERVO, plan))))
    assert verdict == grade(SERVO, source, 3)
    assert verdict.status is not Status.GRADER_FAULT


def test_a_text_is_compiled_once_and_then_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    monkeypatch.setattr(harness, "MODELS", {})
    xml, compile_text = model_xml("pendulum"), harness.compile_text

    def count(text: str) -> mujoco.MjModel:
        texts.append(text)
        return compile_text(text)

    monkeypatch.setattr(harness, "compile_text", count)
    first, second = harness.load_model(xml), harness.load_model(xml)
    first.opt.timestep = 1.0
    assert second.opt.timestep != 1.0
    assert texts == [xml]
