"""What a script makes is compiled and simulated in a process of the jail of its own: models in MJCF."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grader.domain.run import Job, RunReport, RunStatus
from grader.domain.verdict import Status, Verdict
from grader.errors import ScriptStopped
from grader.exercises import (
    Case,
    DrawnCase,
    ExerciseParameters,
    Judgement,
    Kind,
    Limits,
    Measurement,
    Results,
    Trial,
    judge_exercise,
    plan_exercise,
)
from grader.exercises.kind import CPU_S_MAX
from grader.exercises.running.measuring import limit_cpu
from grader.grading.pipeline import Pipeline
from grader.library import Library, load
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.kinds import install_kinds

DRIVER = """
import numpy as np

def trial(functions, inputs, submit):
    (entry,) = functions
    submit("mjcf", np.frombuffer(entry(inputs["mass"]).encode(), dtype=np.uint8))
"""
PROGRAM = """
import mujoco
import numpy as np

def measure(inputs, results, submit):
    model = mujoco.MjModel.from_xml_string(results["mjcf"].tobytes().decode())
    data = mujoco.MjData(model)
    while data.time < inputs["seconds"]:
        mujoco.mj_step(model, data)
    submit("mass", model.body_mass.sum())
    submit("height", data.xipos[-1, 2])
"""


class Falling(Kind[ExerciseParameters, float, float]):
    """A model of a body of a given mass that falls freely for a second."""

    parameters = ExerciseParameters
    driver = DRIVER
    measurement = Measurement(PROGRAM, Limits(cpu_s=1, wall_s=20, memory_mb=256))
    needs_model = False

    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        return [Trial(drawn.case.id, {"mass": 2.5, "seconds": 1.0}, 2.5)]

    def judge(self, parameters: ExerciseParameters, trial: Trial[float], results: Results) -> Judgement[float]:
        mass, height = float(results["mass"]), float(results["height"])
        right = abs(mass - trial.problem) < 1e-9 and abs(height + 9.81 / 2) < 0.02
        return Judgement(right, "It falls as it should." if right else "It falls otherwise.", mass)


MODEL = """
<mujoco>{options}
  <worldbody><body>{more}<freejoint/><geom size="0.1" mass="{mass}"/></body></worldbody>
</mujoco>
"""


def build_script(mass: object = "{mass}", options: str = "", more: str = "") -> str:
    text = MODEL.format(mass=mass, options=options, more=more)
    return f"def build(mass):\n    return {text!r}.replace('{{mass}}', str(mass))\n"


RIGHT = build_script()
HUGE = '<replicate count="200000" offset="1 0 0"><geom size="0.1" mass="1"/></replicate>'
SLOW = '<option timestep="1e-8"/>'
FIELD = '<asset><hfield name="f" file="{}" size="1 1 1 1"/></asset>'


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    folder: Path = tmp_path_factory.mktemp("content")
    (folder / "quizzes").mkdir()
    check = {"kind": "falling", "luck": 1, "cases": [{"id": "a"}, {"id": "b", "hidden": True}]}
    question = {"kind": "code", "id": "f", "q": "?", "entry": "build", "check": check}
    with pytest.MonkeyPatch.context() as patch:
        install_kinds(patch, falling=Falling())
        (folder / "quizzes/q.json").write_text(json.dumps({"id": "q", "title": "Q", "questions": [question]}))
        return load(folder)


@pytest.fixture
def grade(jail: Jail, library: Library, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Verdict]:
    install_kinds(monkeypatch, falling=Falling())
    return lambda source: Pipeline(library, jail.run).grade("q", "f", {"source": source})


def test_a_right_model_is_right_and_a_wrong_one_is_judged(grade: Callable[[str], Verdict]) -> None:
    assert grade(RIGHT).status is Status.CORRECT
    assert grade(build_script(mass=7)).findings[0].message == "It falls otherwise."


@pytest.mark.parametrize(
    ("source", "status", "why"),
    [
        (build_script(options=SLOW), Status.TIMED_OUT, "too much CPU time to compile and simulate: more than 1 s"),
        (build_script(more=HUGE), None, "takes too much"),
        (
            build_script(options='<size memory="4G"/>'),
            Status.OUT_OF_MEMORY,
            "too much memory to compile and simulate: more than 256 MB",
        ),
        (build_script(mass="no number"), Status.CRASHED, "cannot be compiled and simulated"),
        (build_script(options='<include file="/etc/passwd"/>'), Status.CRASHED, "cannot be compiled and simulated"),
        (build_script(options=FIELD.format("/etc/passwd")), Status.CRASHED, "cannot be compiled and simulated"),
    ],
    ids=["a billion steps", "200,000 bodies", "4 GB", "no MJCF", "includes a file", "reads a file"],
)
def test_what_cannot_be_measured_is_the_scripts_fault(
    source: str, status: Status | None, why: str, grade: Callable[[str], Verdict]
) -> None:
    verdict = grade(source)
    ends = {status} if status else {Status.TIMED_OUT, Status.OUT_OF_MEMORY}  # whichever limit is reached first
    assert verdict.status in ends
    assert verdict.points == 0
    assert all(why in finding.message for finding in verdict.findings)
    assert "root:" not in verdict.model_dump_json()


def test_a_model_reads_no_file_of_the_server(grade: Callable[[str], Verdict], tmp_path: Path) -> None:
    part = tmp_path / "part.xml"
    part.write_text("<mujoco><option/></mujoco>")
    assert grade(build_script(options=f'<include file="{part}"/>')).status is Status.CRASHED


def test_a_script_has_no_more_time_with_more_cases() -> None:
    run = limit_cpu(lambda job: RunReport(RunStatus.RETURNED, cpu_s=CPU_S_MAX / 2))
    statuses = [run(Job("", "", {})).status for _ in range(3)]
    assert statuses == [RunStatus.RETURNED, RunStatus.RETURNED, RunStatus.TIMED_OUT]


def test_stopping_while_what_a_script_made_is_measured_uses_an_attempt(
    jail: Jail, library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It had its hidden inputs, and may have made of them what takes long to measure, or not."""
    install_kinds(monkeypatch, falling=Falling())
    source = build_script(options=SLOW)
    pipeline = Pipeline(library, lambda job: jail.run(replace(job, is_stopped=lambda: job.source != source)))
    with pytest.raises(ScriptStopped) as stopped:
        pipeline.grade("q", "f", {"source": source})
    assert stopped.value.has_seen_hidden


def test_one_trial_that_cannot_be_measured_fails_alone(grade: Callable[[str], Verdict]) -> None:
    source = f"{RIGHT}\nright, calls = build, []\n\ndef build(mass):\n    calls.append(mass)\n"
    verdict = grade(f"{source}    return right(mass) if len(calls) == 1 else 'nothing'\n")
    assert (verdict.status, [finding.passed for finding in verdict.findings]) == (Status.PARTIAL, [True, False])
    assert verdict.findings[1].message == "What you made cannot be compiled and simulated."


def test_a_judge_sees_what_was_measured_and_nothing_that_was_forged(
    jail: Jail, library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    install_kinds(monkeypatch, falling=Falling())
    question = library.question("q", "f")
    assert isinstance(question, ScriptQuestion)
    plan = plan_exercise(question, library.model_xml, 1)
    forged: dict[str, Any] = {"mass": np.array(2.5), "height": np.array(-9.81 / 2)}
    text = np.frombuffer(MODEL.format(mass=7, options="", more="").encode(), np.uint8)
    results = {f"t{index}_{name}": array for index in (0, 1) for name, array in {**forged, "mjcf": text}.items()}
    report = RunReport(RunStatus.RETURNED, results=results, hidden_results=results)
    assert judge_exercise(question, plan, report, jail.run).status is Status.INCORRECT
