"""What the runner does for every kind: hiding, crashes, points, reviews, faults, plug-ins."""

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exercises.conftest import ROOT, Grade, model_xml, question, with_check
from grader.domain.run import RunReport, RunStatus
from grader.domain.verdict import Status, Verdict
from grader.errors import GraderError
from grader.exercises import (
    Case,
    DrawnCase,
    ExerciseParameters,
    JudgedTrial,
    Judgement,
    Kind,
    Plan,
    Results,
    Trial,
    check_exercise,
    judge_exercise,
    load_kinds,
    plan_exercise,
    write_lazy_answers,
)
from grader.exercises.driving import recorder
from grader.exercises.kinds.threshold import Threshold
from grader.exercises.running import planning, runner
from grader.exercises.running.diagnosing import describe_success
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.kinds import install_kinds

SOLVED = {
    "servo-threshold": "spectral_radius",
    "rk4-step": "classical",
    "rk4-free-joint": "rotation_vector",
}


EXERCISES = list(SOLVED)
PROGRAMS = ROOT / "reference_solutions" / "1.3-exercises"
NUMBER = re.compile(r"\d+\.?\d*(?:e-?\d+)?")

CLAIMED = (0.0123456, 0.0127891)
"""What scripts below return of hidden models."""

SECRETS = """
import os
import sys
import mujoco
import numpy as np

def numbers(model):
    found = [*model.actuator_gainprm.flat, *model.actuator_biasprm.flat, *model.body_mass, *model.body_ipos.flat]
    found += [*model.tendon_stiffness, *np.abs(model.actuator_biasprm.flat), *np.abs(model.body_ipos.flat)]
    return " ".join(f"{number:.6g}" for number in found) + " 0.0123456 12.3456 0.0127891"

def is_hidden(model):
    servo = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, "servo") >= 0
    return model.actuator_gainprm[0, 0] != 2000 if servo else model.nv not in VISIBLE or calls > FIRST
"""
"""The head of scripts that behave badly in hidden trials alone."""

BADLY = {
    "raises": "raise ValueError(numbers(model))",
    "raises its own": "raise type(numbers(model), (ValueError,), {})(numbers(model))",
    "adds notes": "error = KeyError(numbers(model)); error.add_note(numbers(model)); raise error",
    "chains": "raise OverflowError(numbers(model)) from ValueError(numbers(model))",
    "is refused": "raise PermissionError(1, numbers(model))",
    "is refused by name": "open('/etc/' + numbers(model))",
    "lacks memory": "raise MemoryError(numbers(model))",
    "exits": "raise SystemExit(numbers(model))",
    "interrupts": "raise type(numbers(model), (KeyboardInterrupt,), {})(numbers(model))",
    "prints": "print(numbers(model)); print(numbers(model), file=sys.stderr); os.write(1, numbers(model).encode())",
    "prints by another name": "sys.__stdout__.write(numbers(model)); os.write(2, numbers(model).encode())",
    "returns text": "return numbers(model)",
    "returns numbers": "return 0.0123456, 0.0127891",
    "returns a wide bracket": "return 0.0123456, 0.0151",
    "changes its lines": "sys.modules['linecache'].cache['submission.py'] = (1, None, [numbers(model)] * 99, ''); 1/0",
}


def bad_script(exercise: ScriptQuestion, what: str) -> str:
    """Right in visible trials, bad in hidden ones."""
    right = (PROGRAMS / exercise.id / f"correct__{SOLVED[exercise.id]}.py").read_text()
    entry, threshold = exercise.entry, exercise.check.kind == "threshold"
    arguments = "model, integrator" if threshold else "model, data"
    visible = {
        "rk4-step": "(2,), 500 + 4 + 75 + 150 + 300 + 600",  # with the steps of the probe
        "rk4-free-joint": "(6,), 250 + 3 + 75 + 150 + 300 + 600",
    }
    head = "" if threshold else f"VISIBLE, FIRST = {visible[exercise.id]}\n"
    return (
        f"{right}\n{SECRETS}\n{head}solved = {entry}\ncalls = 0\n\n"
        f"def {entry}({arguments}):\n    global calls\n    calls += 1\n"
        f"    if is_hidden(model):\n        {BADLY[what]}\n    return solved({arguments})\n"
    )


def secrets(exercise: ScriptQuestion, plan: Plan) -> set[float]:
    """The numbers that were drawn for hidden cases, and those that scripts claim of them."""
    drawn: set[float] = set()
    for index, case in enumerate(plan.parameters.cases):
        rng = np.random.default_rng([SEED, index])
        drawn |= {float(f"{rng.uniform(*value):.4g}") for value in case.set.values() if isinstance(value, tuple)}
    assert drawn
    return drawn | set(CLAIMED) | {1000 * value for value in CLAIMED} | {2.7544}


def told_numbers(verdict: Verdict) -> set[float]:
    """Every number in the verdict's JSON, texts included; the times of pictures are public."""
    raw = verdict.model_dump(mode="json", exclude={"max_points", "points"})
    for pictures in raw["evidence"].values():
        for picture in pictures if isinstance(pictures, list) else [pictures or {}]:
            picture.pop("time_s", None)
    return {float(number) for number in NUMBER.findall(json.dumps(raw))}


SEED = 7


@pytest.mark.parametrize(
    ("id_", "what"),
    [
        *(("servo-threshold", what) for what in BADLY),
        *((id_, what) for id_ in EXERCISES[1:] for what in ("raises", "prints", "exits")),
    ],
)
def test_nothing_of_a_hidden_case_is_in_the_verdict(id_: str, what: str, run: Callable[..., RunReport]) -> None:
    exercise = question(id_)
    plan = plan_exercise(exercise, model_xml, SEED)
    report = run(exercise, bad_script(exercise, what), SEED)
    verdict = judge_exercise(exercise, plan, report)
    verdict = verdict.model_copy(update={"stdout": report.stdout, "stderr": report.stderr})
    assert not secrets(exercise, plan) & told_numbers(verdict)
    assert "submission.py" not in verdict.stderr
    if report.status is RunStatus.RETURNED:
        visible = [trial.id for trial in plan.trials if not trial.hidden]
        assert all(finding.passed for finding in verdict.findings if finding.id in visible)


ARRAYS: Any = st.sampled_from(["claim", "other", "raised", "q0", "v0", "t0", "a0", "refused", "nonsense"])
VALUES: Any = st.one_of(
    st.lists(st.floats(-1e3, 1e3), max_size=4).map(np.array),
    st.sampled_from([np.zeros((2, 2)), np.zeros((500, 2)), np.zeros((500, 1)), np.zeros((500, 0)), np.array(True)]),
    st.binary(max_size=60).map(lambda data: np.frombuffer(data, np.uint8)),
    st.fixed_dictionaries({"raised": st.text(max_size=20), "line": st.one_of(st.none(), st.integers(), st.text())}).map(
        lambda said: np.frombuffer(json.dumps(said).encode(), np.uint8)
    ),
)


@settings(max_examples=60)
@given(st.sampled_from(EXERCISES), st.dictionaries(st.tuples(st.integers(0, 12), ARRAYS), VALUES, max_size=12))
def test_no_result_makes_the_judge_fail(id_: str, results: dict[tuple[int, str], Any]) -> None:
    plan = plan_exercise(question(id_), model_xml, SEED)
    named = {f"t{index}_{name}": values for (index, name), values in results.items()}
    verdict = judge_exercise(question(id_), plan, RunReport(RunStatus.RETURNED, results=named, hidden_results=named))
    hidden = [trial.id for trial in plan.trials if trial.hidden]
    assert all(f.measured is None and f.expected is None for f in verdict.findings if f.id in hidden)
    assert verdict.status in (Status.INCORRECT, Status.CRASHED, Status.PARTIAL)
    assert 0 <= verdict.points < verdict.max_points


SERVO = question("servo-threshold")
RIGHT = (PROGRAMS / "servo-threshold" / "correct__spectral_radius.py").read_text()


def test_what_is_printed_at_import_and_in_visible_cases_comes_back(run: Callable[..., RunReport]) -> None:
    source = (
        "import ctypes, sys\nprint('at import')\ncount = 0\n"
        "def largest_stable_timestep(model, integrator):\n    global count\n    count += 1\n"
        "    print('call', count)\n    print('error', count, file=sys.stderr)\n"
        "    ctypes.CDLL(None).printf(b'from C %d\\n', count)\n"
    )
    report = run(SERVO, source)
    assert report.status is RunStatus.RETURNED
    printed = ["at import", "call 1", "call 2", "call 3", "from C 1", "from C 2", "from C 3"]
    assert sorted(report.stdout.splitlines()) == printed
    assert report.stderr.splitlines() == ["error 1", "error 2", "error 3"]


def test_what_is_printed_in_visible_cases_comes_back_when_the_script_is_killed(run: Callable[..., RunReport]) -> None:
    exercise = SERVO.model_copy(update={"limits": SERVO.limits.model_copy(update={"cpu_s": 1})})
    source = (
        "def largest_stable_timestep(model, integrator):\n    print('seen')\n"
        "    while model.actuator_gainprm[0, 0] != 2000:\n        print('hidden')\n"
    )
    report = run(exercise, source)
    assert (report.status, report.stdout) == (RunStatus.TIMED_OUT, "seen\n" * 3)


def test_a_trial_that_raises_is_lost_alone(run: Callable[..., RunReport]) -> None:
    source = RIGHT + (
        "\nfound = largest_stable_timestep\n\n"
        "def largest_stable_timestep(model, integrator):\n"
        "    if integrator == 3:\n        return [][1]\n    return found(model, integrator)\n"
    )
    line = source.splitlines().index("        return [][1]") + 1
    report = run(SERVO, source)
    verdict = judge_exercise(SERVO, plan_exercise(SERVO, model_xml, 1), report)
    assert verdict.status is Status.PARTIAL
    failed = [finding for finding in verdict.findings if not finding.passed]
    assert {finding.id.split(".")[1] for finding in failed} == {"implicitfast"}
    said = f"IndexError: list index out of range, in line {line} of your script."
    assert [finding.message for finding in failed] == [said, *[f"IndexError, in line {line} of your script."] * 6]
    assert verdict.diagnosis == f"kp = 2000, kv = 5, implicitfast: {said}"
    assert report.stderr.count("return [][1]") == 1


def test_a_script_that_always_raises_has_crashed(grade: Grade) -> None:
    verdict = grade(SERVO, "def largest_stable_timestep(model, integrator):\n    return 1 / 0\n")
    assert (verdict.status, verdict.points) == (Status.CRASHED, 0)
    assert verdict.diagnosis == ("ZeroDivisionError: division by zero, in line 2 of your script.")
    assert len(verdict.findings) == 21


@pytest.mark.parametrize(
    ("exception", "said"),
    [
        ("ValueError('\\ud800\\u202ex')", "ValueError: \ufffd\ufffdx"),
        ("KeyError('\\ud800')", "KeyError: '\\ud800'"),
        ("ValueError('a'); e.add_note('\\ud800')", "ValueError: a"),
    ],
)
def test_what_no_text_can_hold_is_replaced_in_what_was_raised(exception: str, said: str, grade: Grade) -> None:
    verdict = grade(SERVO, f"def largest_stable_timestep(model, integrator):\n    e = {exception}\n    raise e\n")
    assert verdict.status is Status.CRASHED
    assert verdict.diagnosis == f"{said}, in line 3 of your script."
    assert Verdict.model_validate_json(verdict.model_dump_json()) == verdict


@pytest.mark.parametrize("id_", ["servo-threshold", "rk4-step"])
def test_what_a_returned_value_says_of_itself_is_cleaned(id_: str, grade: Grade) -> None:
    exercise = question(id_)
    odd = "class A:\n    def __repr__(self): return '\\x1b[2J\\x00\\u202e correct\\n  + all'\n\n"
    verdict = grade(exercise, f"{odd}def {exercise.entry}(*arguments): return A()\n")
    told = "".join(f"{finding.message}{finding.direction}{finding.measured}" for finding in verdict.findings)
    assert not [c for c in f"{told}{verdict.diagnosis}" if c in "\x1b\0\u202e\n"]


@pytest.mark.parametrize(
    ("id_", "source", "told"),
    [
        ("servo-threshold", "def largest_stable_timestep(model, integrator):\n    yield 0.005\n", "holds `yield`"),
        ("rk4-step", "async def rk4_step(model, data):\n    data.time += model.opt.timestep\n", "is an `async def`"),
    ],
)
def test_a_function_of_which_nothing_runs_is_told_so(id_: str, source: str, told: str, grade: Grade) -> None:
    verdict = grade(question(id_), source)
    assert verdict.status is Status.INCORRECT
    assert told in (verdict.diagnosis or "")


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("open('/etc/passwd')", Status.FORBIDDEN),
        ("raise MemoryError", Status.OUT_OF_MEMORY),
        ("raise SystemExit", Status.CRASHED),
        ("raise KeyboardInterrupt", Status.CRASHED),
    ],
)
@pytest.mark.parametrize("where", ["True", "model.actuator_gainprm[0, 0] != 2000"])
def test_what_ends_the_whole_script(line: str, status: Status, where: str, grade: Grade) -> None:
    source = f"def largest_stable_timestep(model, integrator):\n    if {where}:\n        {line}\n"
    verdict = grade(SERVO, source)
    assert (verdict.status, verdict.findings) == (status, ())


@pytest.mark.parametrize("id_", EXERCISES)
def test_the_process_gets_the_hidden_trials_apart_from_the_visible_ones(id_: str) -> None:
    exercise = question(id_)
    plan = plan_exercise(exercise, model_xml, SEED)
    job = plan.build_job("", exercise.limits)
    hidden = [index for index, trial in enumerate(plan.trials) if trial.hidden]
    assert [trial["index"] for trial in job.hidden_inputs["trials"]] == hidden
    numbers = {float(number) for number in NUMBER.findall(json.dumps(job.inputs))}
    drawn = secrets(exercise, plan)
    assert not numbers & drawn
    assert drawn & {float(number) for number in NUMBER.findall(json.dumps(job.hidden_inputs))}


class Echo(Kind[ExerciseParameters, float, float]):
    """Asks for each case's number; a trial passes where it is returned. Any number above 9 needs the first case."""

    parameters = ExerciseParameters
    driver = "def trial(functions, inputs, submit):\n    submit('said', functions[0](inputs['number']))\n"
    needs_model = False

    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        number = float(drawn.numbers.get("n", 0))
        return [Trial(drawn.case.id, {"number": number}, number)]

    def judge(self, parameters: ExerciseParameters, trial: Trial[float], results: Results) -> Judgement[float]:
        said = float(results["said"].flat[0]) if "said" in results else -1.0
        needs = (parameters.cases[0].id,) if trial.problem > 9 else ()
        doubt = "Is this right?" if said == 5 else ""
        return Judgement(said == trial.problem, "Said.", said, f"{said:g}.", said, 0.0, needs, "Not yet.", doubt)


@pytest.fixture
def echo(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Verdict]:
    install_kinds(monkeypatch, echo=Echo())

    def judge(*said: float, **changes: Any) -> Verdict:
        number = {"element": "x", "attribute": "y"}
        cases = [
            {"id": "one", "points": 3, "set": {"n": 1}, "hint": "The first goes wrong.", **changes},
            {"id": "ten", "hidden": True, "points": 1, "set": {"n": 10}},
        ]
        check = {"kind": "echo", "numbers": {"n": number}, "cases": cases}
        raw = {"kind": "code", "id": "e", "q": "?", "entry": "f", "points": 8, "explain": "So.", "check": check}
        exercise = ScriptQuestion.model_validate(raw)
        assert check_exercise(exercise, model_xml, "f") == []
        results = {f"t{index}_said": np.array([value]) for index, value in enumerate(said)}
        return judge_exercise(
            exercise,
            plan_exercise(exercise, model_xml, 1),
            RunReport(RunStatus.RETURNED, results=results, hidden_results=results),
        )

    return judge


def test_a_result_that_is_not_finite_loses_its_trial_alone(jail: Jail, monkeypatch: pytest.MonkeyPatch) -> None:
    install_kinds(monkeypatch, echo=Echo())
    number = {"element": "x", "attribute": "y"}
    cases = [{"id": "one", "set": {"n": 1}}, {"id": "two", "set": {"n": 2}}]
    check = {"kind": "echo", "numbers": {"n": number}, "cases": cases}
    exercise = ScriptQuestion.model_validate({"kind": "code", "id": "e", "q": "?", "entry": "f", "check": check})
    plan = plan_exercise(exercise, model_xml, 1)
    report = jail.run(plan.build_job("def f(n):\n    return n if n == 1 else float('nan')\n", exercise.limits))
    verdict = judge_exercise(exercise, plan, report)
    assert [finding.passed for finding in verdict.findings] == [True, False]
    assert verdict.diagnosis == "two: ValueError: the result said holds a number that is not finite (nan or inf)."


class Shares(Echo):
    """Divides each case into a trial of one share and one of three."""

    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        return [Trial(f"{drawn.case.id}.{share}", {"number": 0}, 0.0, points=share) for share in (1, 3)]


def test_trials_are_hidden_with_their_case_and_share_its_points(monkeypatch: pytest.MonkeyPatch) -> None:
    install_kinds(monkeypatch, shares=Shares())
    cases = [{"id": "a", "points": 1}, {"id": "b", "hidden": True, "points": 2}]
    raw = {"kind": "code", "id": "e", "q": "?", "entry": "f", "check": {"kind": "shares", "cases": cases}}
    trials = plan_exercise(ScriptQuestion.model_validate(raw), model_xml, 1).trials
    assert [(trial.id, trial.hidden, trial.points) for trial in trials] == [
        ("a.1", False, 0.25),
        ("a.3", False, 0.75),
        ("b.1", True, 0.5),
        ("b.3", True, 1.5),
    ]


class Arrays(Echo):
    """Forgets that evidence is plain JSON."""

    def __init__(self, key: str) -> None:
        self.key = key

    def build_pictures(
        self, parameters: ExerciseParameters, visible: Sequence[JudgedTrial[float, float]]
    ) -> dict[str, Any]:
        return {self.key: np.zeros(2), "left": 1}


def judge_arrays(monkeypatch: pytest.MonkeyPatch, key: str) -> Verdict:
    install_kinds(monkeypatch, arrays=Arrays(key))
    raw = {"kind": "code", "id": "e", "q": "?", "entry": "f", "check": {"kind": "arrays", "cases": [{"id": "a"}]}}
    exercise = ScriptQuestion.model_validate(raw)
    plan = plan_exercise(exercise, model_xml, 1)
    return judge_exercise(exercise, plan, RunReport(RunStatus.RETURNED, results={"t0_said": np.zeros(1)}))


def test_evidence_that_is_no_json_is_refused_before_it_is_saved(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match=r"evidence\.own"):
        judge_arrays(monkeypatch, "own")


@pytest.mark.parametrize("key", ["charts", "motions", "tables", "film"])
def test_pictures_that_no_page_can_draw_cost_the_learner_nothing_else(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], key: str
) -> None:
    verdict = judge_arrays(monkeypatch, key)
    assert (verdict.status, verdict.points) == (Status.CORRECT, 1.0)
    assert verdict.evidence["left"] == 1
    assert key not in verdict.evidence
    (fault,) = verdict.evidence["faults"]
    assert fault.startswith(f"{key}: must be ")
    assert "a kind builds pictures that no page can draw" in capfd.readouterr().err


def test_points_are_scaled_and_the_explanation_comes_with_all_of_them(echo: Callable[..., Verdict]) -> None:
    verdict = echo(1, 10)
    assert [(f.points, f.max_points) for f in verdict.findings] == [(6, 6), (2, 2)]
    assert (verdict.status, verdict.explain, verdict.diagnosis) == (Status.CORRECT, "So.", None)
    assert echo(1, 2).explain is None


def test_points_that_need_another_trial(echo: Callable[..., Verdict]) -> None:
    verdict = echo(2, 10)
    assert (verdict.status, verdict.points) == (Status.INCORRECT, 0)
    assert [f.message for f in verdict.findings] == ["Said. 2.", "Not yet."]


def test_the_hint_is_the_diagnosis_before_the_message(echo: Callable[..., Verdict]) -> None:
    assert echo(2, 10).diagnosis == "The first goes wrong."
    assert echo(2, 10, hint=None).diagnosis == "one: Said."
    assert echo(1, 2).diagnosis == "hidden case 1: Said."


def test_a_kind_may_ask_for_a_person(echo: Callable[..., Verdict]) -> None:
    verdict = echo(1, 5)
    assert (verdict.status, verdict.points, verdict.diagnosis) == (Status.NEEDS_REVIEW, 6, "Is this right?")
    assert verdict.findings[-1].passed is None
    assert echo(5, 5).status is Status.INCORRECT


def test_two_packages_with_one_name_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("rk4", "grader.exercises.kinds.rk4:Rk4", planning.GROUP)
    monkeypatch.setattr(planning, "find_points", lambda group: EntryPoints([point, point]))
    load_kinds.cache_clear()
    try:
        with pytest.raises(GraderError, match="two installed packages provide the exercise kind 'rk4'"):
            load_kinds()
    finally:
        load_kinds.cache_clear()


@pytest.mark.parametrize("id_", EXERCISES)
def test_lazy_answers_earn_at_most_the_visible_trials(id_: str, grade: Grade) -> None:
    exercise = question(id_)
    assert exercise.starter
    lazy = write_lazy_answers(exercise, model_xml, (ROOT / exercise.starter).read_text())
    assert lazy[0].points_max == 0
    assert len(lazy) > 2
    assert 0 < lazy[1].points_max < exercise.points
    for one in lazy:
        assert grade(exercise, one.source).points <= one.points_max + 1e-6


def test_a_fault_is_told_once_at_its_own_key() -> None:
    cases = [{"id": "a", "set": {"kp": 1, "mas": 1}}, {"id": "b", "set": {"kp": 2}}, {"id": "b", "set": {"mas": 1}}]
    changes: dict[str, Any] = {"numbers": {"kp": {"element": "motor[@name='x']", "attribute": "kp"}}, "cases": cases}
    assert [fault.key for fault in check_exercise(with_check(SERVO, **changes), model_xml, "f")] == [
        "servo-threshold.check.cases.0.set.mas",
        "servo-threshold.check.cases.2.id",
        "servo-threshold.check.cases.2.set.mas",
        "servo-threshold.check.numbers.kp.element",
    ]


@pytest.mark.parametrize(
    ("changes", "key", "why"),
    [
        ({"horizon": 3}, "horizon", "unknown key: write 'horizon_s', or remove it, or begin it with x-"),
        ({"cases": [{"title": "a"}]}, "cases.0.id", "is missing: add it"),
        (
            {"cases": [{"id": "a", "set": {"kp": "much"}}]},
            "cases.0.set.kp",
            "must be a valid number, not 'much'",
        ),
        ({"horizon_s": 0}, "horizon_s", "must be greater than 0, not 0"),
        ({"search_s": [2, 1]}, "search_s", "runs from 2 down to 1: write [1, 2]"),
        (
            {"start": {"hinge": 1e300}},
            "start.hinge",
            "must be 0, or from 1e-100 to 1e+100 in size: take another unit, not 1e+300",
        ),
        (
            {"horizon_s": 0.01},
            "horizon_s",
            "must be from 0.05 (one step at the longest timestep) to 1000 (1000000 steps at the shortest), not 0.01",
        ),
        ({"search_s": [0.5, 2]}, "search_s", "must be [shortest, longest], two timesteps from 0.00001 to 1 s"),
        ({"width_s": 0.05}, "width_s", "must be less than the range of the search, which is 0.049 s wide, not 0.05"),
        ({"cases": [{"id": "a", "set": {"kp": [3, 1]}}]}, "cases.0.set.kp", "runs from 3 down to 1: write [1, 3]"),
        ({"cases": [{"id": "a", "set": {"kp": True}}]}, "cases.0.set.kp", "must be a valid number, not True"),
        ({"numbers": {"kp": {"element": "x"}}}, "numbers.kp.attribute", "is missing: add it"),
    ],
)
def test_a_parameter_that_cannot_be_read_is_told_in_plain_words(changes: dict[str, Any], key: str, why: str) -> None:
    (fault,) = check_exercise(with_check(SERVO, **changes), model_xml, "f")
    assert (fault.key, fault.why) == (".".join(filter(None, ("servo-threshold.check", key))), why)


LEAK = "h4711"
"""What scripts below try to tell of a hidden trial; it stands for the numbers of the trial."""


def note_of(name: str, info: object, numbers: Sequence[float] = ()) -> bytes:
    text, values = json.dumps(info).encode(), np.array(numbers, "<f8").tobytes()
    return recorder.encode_note(name, text, values)


def run_at(timestep_s: float, qpos: float = 1.0, ctrl: float = 0.0) -> list[float]:
    """One run of the note `search`, without a warning."""
    return [0, timestep_s, 0, 0.0, qpos, 0.0, 0, ctrl, 3.0, 0, timestep_s]


SEARCH = {"total": 3, "created": 3, "given": 0, "set_s": 0.0, "models": [[]], "others": []}
FORGED = {
    "message of a handled exception": note_of(
        "handled", {"type": "KeyError", "line": 3, "clause": 4, "times": 1, "message": LEAK}
    ),
    "line of a handled exception": note_of(
        "handled", {"type": "KeyError", "line": 471147, "clause": 4, "times": 1, "message": ""}
    ),
    "type of a returned value": note_of("search", SEARCH, run_at(0.02)) + note_of("returned", {"type": LEAK}),
    "printed number": note_of("search", SEARCH, run_at(0.02)) + note_of("printed", {"text": "0.4711"}),
    "fields of the model": note_of("search", SEARCH | {"models": [[LEAK]]}, run_at(0.02) + run_at(0.03)),
    "timesteps": note_of("search", SEARCH, run_at(0.04711)),
    "start": note_of("search", SEARCH, run_at(0.02, qpos=0.4711) + run_at(0.03, qpos=0.4711)),
    "target": note_of("search", SEARCH, run_at(0.02, ctrl=0.4711) + run_at(0.03, ctrl=0.4711)),
}


@pytest.mark.parametrize("claim", [[], [0.0123, 0.0126], None])
@pytest.mark.parametrize("what", FORGED)
def test_a_forged_trace_tells_nothing_of_a_hidden_case(
    what: str, claim: list[float] | None, run: Callable[..., RunReport]
) -> None:
    plan, report = plan_exercise(SERVO, model_xml, SEED), run(SERVO, RIGHT, SEED)
    hidden, traces = dict(report.hidden_results), b""
    for index, trial in enumerate(plan.trials):
        if trial.hidden:
            del hidden[f"t{index}_claim"]
            hidden |= {} if claim is None else {f"t{index}_claim": np.array(claim, dtype=np.float64)}
            traces += b"".join(n.to_bytes(4, "little") for n in (index, len(FORGED[what]))) + FORGED[what]
    hidden["hidden_traces"] = np.frombuffer(traces, np.uint8)
    verdict = judge_exercise(SERVO, plan, replace(report, hidden_results=hidden))
    assert verdict.status is Status.PARTIAL
    assert "4711" not in verdict.model_dump_json(exclude={"evidence"})


def test_the_line_of_a_hidden_exception_is_a_line(run: Callable[..., RunReport]) -> None:
    plan, report = plan_exercise(SERVO, model_xml, SEED), run(SERVO, RIGHT, SEED)
    said = np.frombuffer(b'{"raised": "KeyError", "line": 47110815}', np.uint8)
    hidden = {f"t{index}_raised": said for index, trial in enumerate(plan.trials) if trial.hidden}
    verdict = judge_exercise(SERVO, plan, replace(report, hidden_results=hidden))
    assert "KeyError" in verdict.model_dump_json()
    assert "4711" not in verdict.model_dump_json(exclude={"evidence"})


def test_hidden_exceptions_tell_one_name_and_one_line_of_the_script(run: Callable[..., RunReport]) -> None:
    plan, report = plan_exercise(SERVO, model_xml, SEED), run(SERVO, RIGHT, SEED)
    at = [index for index, trial in enumerate(plan.trials) if trial.hidden]
    names = ("KeyError", "IndexError", "KeyError", "OSError", "TypeError", "LookupError")
    lines = (3, 3, 3, 4, 4711, 5)
    hidden = {
        f"t{index}_raised": np.frombuffer(json.dumps({"raised": name, "line": line}).encode(), np.uint8)
        for index, name, line in zip(at, names, lines, strict=False)
    }
    verdict = judge_exercise(SERVO, plan, replace(report, hidden_results=hidden), source=RIGHT)
    told = [finding.message for finding in verdict.findings if finding.id.startswith("hidden-")]
    first = "KeyError, in line 3 of your script."
    assert told[:6] == [first, "An exception.", first, *["An exception."] * 3]


def test_the_ids_of_hidden_cases_are_told_to_nobody(grade: Grade) -> None:
    verdict = grade(SERVO, RIGHT, SEED)
    cases = {case["id"] for case in SERVO.check.parameters["cases"] if case.get("hidden")}
    ids = [finding.id for finding in verdict.findings]
    assert cases
    assert [id_ for id_ in ids if id_.split(".")[0] in cases] == []
    assert {id_.split(".")[0] for id_ in ids} >= {f"hidden-{index + 1}" for index in range(len(cases))}


def test_a_fault_of_ours_costs_the_sentence_and_not_the_verdict(
    run: Callable[..., RunReport], monkeypatch: pytest.MonkeyPatch
) -> None:
    faults: list[str] = []
    monkeypatch.setattr(runner, "note_fault", lambda error, kind: faults.append(f"{kind}: {type(error).__name__}"))
    monkeypatch.setattr(Threshold, "name_mistake", lambda *_: "".index("a mistake"))
    plan, report = plan_exercise(SERVO, model_xml, SEED), run(SERVO, RIGHT, SEED)
    verdict = judge_exercise(SERVO, plan, replace(report, hidden_results={}))
    assert verdict.status is Status.PARTIAL
    assert verdict.diagnosis
    assert faults == ["threshold: ValueError"]


def test_a_condition_of_any_length_is_read(grade: Grade) -> None:
    terms = "+".join(["0*i"] * 600)
    own = f"""
import mujoco
def largest_stable_timestep(model, integrator):
    model.opt.timestep = 0.01
    data = mujoco.MjData(model)
    for i in range(40):
        mujoco.mj_step(model, data)
        if abs(data.qpos[0]) > 0.5 and i > 3 + {terms}:
            break
    return 0.01, 0.0102
"""
    verdict = grade(SERVO, own, SEED)
    assert verdict.status in (Status.INCORRECT, Status.PARTIAL), verdict.diagnosis


def test_two_cases_that_hold_are_both() -> None:
    kind = cast(Any, SimpleNamespace(describe_success=lambda parameters, judged: ""))

    def describe(*hidden: bool) -> str:
        judged = cast(Any, [SimpleNamespace(hidden=one) for one in hidden])
        return describe_success(kind, cast(Any, None), judged)

    assert describe(False) == "The case holds."
    assert describe(False, True) == "Both cases hold, the hidden one too."
    assert describe(False, True, True) == "All 3 cases hold, the 2 hidden ones too."
