"""Claims of measurements, through the real jail: every reference program gets its status and its diagnosis; and what we
measure them against, by closed forms."""

import json
from collections import Counter, UserDict, namedtuple
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import exp, pi, sqrt
from pathlib import Path
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.domain.quantities import QuantityName, Window
from grader.domain.verdict import Verdict
from grader.exercises import JudgedTrial, check_exercise, load_kinds, plan_exercise
from grader.exercises.kinds.claims.driver import name_values, separate, to_numbers
from grader.exercises.kinds.claims.measuring import measure_claims
from grader.exercises.kinds.claims.mistakes import name_the_mistake
from grader.exercises.kinds.claims.naming import name_reading
from grader.exercises.rehearsing import certify_exercise
from grader.experiments.quantities import measure
from grader.grading.pipeline import Pipeline
from grader.grading.references import read_demand
from grader.questions import question_adapter
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.content import load_content
from support.sites import ROOT

QUIZ = "2.1-exercises"
PROGRAMS = sorted((ROOT / "reference_solutions" / QUIZ).glob("*/*.py"))
SEED = 7
CLAIMS = load_kinds()["claims"]


@pytest.fixture(scope="module")
def pipeline() -> Iterator[Pipeline]:
    library = load_content(QUIZ)
    with Jail(library.root / "models", workers=2, allow_t2=True) as jail:
        yield Pipeline(library, jail.run)


def grade(pipeline: Pipeline, question: str, source: str, seed: int = SEED) -> Verdict:
    return pipeline.grade(QUIZ, question, {"source": source}, seed)


@pytest.mark.jail
@pytest.mark.slow
@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_program_is_judged_and_named_as_expected(path: Path, pipeline: Pipeline) -> None:
    source = path.read_text()
    status, diagnosis = read_demand(source, path.stem.partition("__")[0])
    verdict = grade(pipeline, path.parent.name, source)
    assert verdict.status == status, verdict.diagnosis
    assert (diagnosis or "") in (verdict.diagnosis or "")
    assert all(len(row) == len(table["head"]) for table in verdict.evidence.get("tables", ()) for row in table["rows"])
    json.dumps(verdict.evidence, allow_nan=False)


GRAZES = {"shaker": [1011, 1018, 1062], "ring": [2155035557301432]}
"""Seeds of cases in which a peak grazes the band: the own timestep and its limit are half a swing apart."""

AT_REST = """import mujoco, numpy as np
def shake(model, data):
    push = lambda t: 8 * np.sin(6 * t)
    def run(seconds, force):
        mujoco.mj_resetData(model, data)
        q = []
        for _ in range(round(seconds / model.opt.timestep)):
            data.ctrl[0] = force(data.time)
            mujoco.mj_step(model, data)
            q.append(data.qpos[0])
        return np.array(q)
    steady = run(9, push)[round(6 / model.opt.timestep):]
    q, rest = run(12, lambda t: 12), 12 / model.jnt_stiffness[0]
    last = np.flatnonzero(abs(q - rest) > 2e-3)[-1]
    return {"amplitude": np.ptp(steady) / 2, "settled": (last + 2) * model.opt.timestep, "rest": (rest, rest)}
"""
"""Settles about the exact place of rest, 12 N over the stiffness, and claims that place alone."""


@pytest.mark.jail
@pytest.mark.slow
@pytest.mark.parametrize("question", GRAZES)
def test_where_a_peak_grazes_the_band_either_settling_time_is_right(question: str, pipeline: Pipeline) -> None:
    right = [path.read_text() for path in PROGRAMS if path.parent.name == question and path.stem.startswith("correct")]
    for source in [*right, *[AT_REST] * (question == "shaker")]:
        for seed in GRAZES[question]:
            verdict = grade(pipeline, question, source, seed)
            assert verdict.status == "correct", (seed, verdict.diagnosis)


def test_there_are_enough_of_them() -> None:
    statuses = Counter(path.stem.partition("__")[0] for path in PROGRAMS)
    assert statuses["correct"] >= 8
    assert statuses.total() - statuses["correct"] >= 25


@pytest.mark.parametrize(
    ("values", "read"),
    [
        ([1, 2.5, np.float32(3)], [1, 2.5, 3]),
        ([1.5, True], None),
        (["1", 2.0], None),
        ([10**400], None),
        ([np.nan, 1], None),
    ],
)
def test_objects_that_are_plain_numbers_are_read_as_numbers(values: list[Any], read: list[float] | None) -> None:
    numbers = to_numbers(np.array(values, dtype=object))
    assert read is None if numbers is None else (numbers.tolist() == read and numbers.dtype == np.float64)


TIMES = np.linspace(0, 20, 20_001)
SERIES = {
    "square": TIMES**2,
    "line": TIMES,
    "sine": np.sin(TIMES),
    "cosine": np.cos(TIMES),
    "quick": np.sin(pi * TIMES),
    "raised": 5 + 3 * np.sin(pi * TIMES),
    "decay": np.exp(-TIMES),
    "swing": 2 * np.exp(-0.1 * TIMES) * np.cos(3 * TIMES),
}


@pytest.mark.parametrize(
    ("name", "series", "window", "right"),
    [
        ("final", "square", Window(), 400),
        ("final", "square", Window(until=10.0), 100),
        ("max", "sine", Window(), 1),
        ("min", "swing", Window(since=0.5, until=2.0), -2 * exp(-0.1 * 1.0361) * 0.99945),
        ("mean", "line", Window(), 10),
        ("rms", "quick", Window(), sqrt(0.5)),
        ("amplitude", "raised", Window(), 3),
        ("peak_to_peak", "raised", Window(), 6),
        ("crossing", "cosine", Window(level=0.5, direction="down", count=2), pi / 3 + 2 * pi),
        ("crossing", "cosine", Window(level=0.0, direction="either", count=3), 5 * pi / 2),
        ("period", "swing", Window(level=0.0), 2 * pi / 3),
        ("frequency", "swing", Window(level=0.0), 3 / (2 * pi)),
        ("decay_rate", "swing", Window(), 0.1),
        ("settling", "decay", Window(level=0.0, band=0.01), np.log(100)),
        ("settling", "cosine", Window(level=0.0, band=0.01), np.nan),
        ("period", "line", Window(), np.nan),
    ],
)
def test_quantities_are_those_of_closed_forms(name: QuantityName, series: str, window: Window, right: float) -> None:
    assert measure(name, TIMES, SERIES[series], window) == pytest.approx(right, rel=2e-4, nan_ok=True)


@given(st.floats(0, 0.4), st.floats(0, 2 * np.pi), st.integers(3, 10), st.floats(-5, 5))
def test_the_period_of_a_decay_is_that_about_its_rest(decay: float, phase: float, periods: int, rest: float) -> None:
    """Of A exp(-decay t) cos(2 pi t + phase) it is 1, whatever the decay; about the middle it is up to 4 % off."""
    times = np.arange(0, periods + 1e-9, 0.002)
    values = rest + np.exp(-decay * times) * np.cos(2 * np.pi * times + phase)
    assert measure("period", times, values) == pytest.approx(1, rel=1e-3)
    assert measure("frequency", times, values) == pytest.approx(1, rel=1e-3)


SPRING = """<mujoco><option timestep="0.002" gravity="0 0 0" integrator="RK4"/><worldbody><body>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><joint name="x" type="slide" stiffness="50" damping="0.8"/>
</body></worldbody></mujoco>"""


def pose(case: dict[str, Any] | None = None, **check: Any) -> ScriptQuestion:
    """Returns an exercise about a mass on a spring, w = 5/s, that decays at 0.2/s."""
    one = {"id": "a", "xml": SPRING, "start": {"qpos": [0.1]}, **(case or {})}
    raw = {"kind": "code", "id": "spring", "q": "?", "entry": "f",
           "check": {"kind": "claims", "seconds": 6, "cases": [one], **check}}  # fmt: skip
    question = question_adapter().validate_python(raw)
    assert isinstance(question, ScriptQuestion)
    return question


def diagnose(question: ScriptQuestion, *claims: Any) -> str | None:
    """Returns the diagnosis of claims in the only case; None where all are right."""
    plan = plan_exercise(question, lambda _: "", 1)
    results = {f"c{index}": np.array(claim, dtype=np.float64) for index, claim in enumerate(claims)}
    judgement = CLAIMS.judge(plan.parameters, plan.trials[0], results)
    if judgement.passed:
        return None
    return name_the_mistake([JudgedTrial(plan.trials[0], judgement, counts=False)]) or judgement.message


RATE = {"name": "rate", "quantity": "decay_rate", "expr": "data.qpos[0]", "level": 0, "unit": "1/s", "rtol": 0.01}
PLACE = {"name": "place", "quantity": "trace", "form": "curve", "expr": "data.qpos[0]", "unit": "m", "rtol": 0.01}


def test_what_is_measured_is_the_limit_and_curves_are_compared_point_by_point() -> None:
    w = sqrt(25 - 0.04)
    x = [0.5, 1.0, 1.5]
    right = [0.1 * exp(-0.2 * t) * (np.cos(w * t) + 0.2 / w * np.sin(w * t)) for t in x]
    question = pose({"x": x}, claims=[RATE, PLACE], x={"label": "time", "unit": "s"})
    assert certify_exercise(question, lambda _: "", "q.json") == []
    assert diagnose(question, 0.2, right) is None
    assert diagnose(question, 5.0, right) == "Rate is the time constant: the rate is one over it."
    assert diagnose(question, 0.2, np.multiply(right, 1000)) == "Place is in mm, and m is asked for."
    assert diagnose(question, 0.2, right[::-1]) == (
        "Place is in the opposite order: the first number belongs to the first x."
    )
    assert diagnose(question, 0.2, [right[0]]) == "Place has the wrong shape: 3 numbers are asked for."
    assert diagnose(question, 0.2, [right[0], right[1], right[2] + 0.01]) == "Place is in places too high."
    assert diagnose(question, [[0.2]], right) is None  # an array of one number


def test_each_run_of_a_sweep_must_begin_anew() -> None:
    speed = {"name": "speed", "quantity": "max", "form": "curve", "expr": "data.qvel[0]", "rtol": 0.005}
    question = pose({"x": [0.1, 0.2]}, claims=[speed], seconds=2, x={"label": "x", "apply": "data.qpos[0] = value"})
    model = mujoco.MjModel.from_xml_string(SPRING)
    data = mujoco.MjData(model)
    speeds: dict[bool, list[float]] = {True: [], False: []}
    for is_reset, found in speeds.items():
        for x in (0.1, 0.2):
            if is_reset:
                mujoco.mj_resetData(model, data)
            data.qpos[0], record = x, [data.qvel[0]]
            for _ in range(1000):
                mujoco.mj_step(model, data)
                record.append(data.qvel[0])
            found.append(max(record))
        mujoco.mj_resetData(model, data)
    assert diagnose(question, speeds[True]) is None
    assert "reset the data" in (diagnose(question, speeds[False]) or "")
    assert diagnose(question, [speeds[True][0]] * 2) == "Speed is the same for every x: use x."


@pytest.mark.jail
@pytest.mark.slow
@pytest.mark.parametrize(
    ("expr", "name"),
    [
        ("data.qpos[0]", "position of slide [m]"),
        ("lib.qvel('arm')", "velocity of arm [rad/s]"),
        ("Math.abs(data.qvel[1])", "|velocity of arm| [rad/s]"),
        ("data.sensordata[3]", "height"),
        ("lib.sensor('height')", "height"),
        ("lib.energy().total", "total energy [J]"),
        ("data.sensordata[0]", None),
        ("data.qpos[2]", None),
        ("data.qpos[9]", None),
        ("lib.qpos('nobody')", None),
        ("data.qpos[0] + data.qpos[1]", None),
        ("data.xpos[3]", None),
    ],
)
def test_an_axis_is_named_by_what_is_read(expr: str, name: str | None) -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="slide" type="slide"/><geom size="1"/><site name="tip"/>
        <body><joint name="arm"/><geom size="1"/><body><joint type="ball" name="ball"/><geom size="1"/></body></body>
        </body></worldbody><sensor><framepos objtype="site" objname="tip"/><jointpos name="height" joint="slide"/>
        </sensor></mujoco>"""
    )
    assert name_reading(expr, model) == name


def test_nothing_that_is_measured_enters_the_jail(pipeline: Pipeline) -> None:
    for name in ("swing", "ring", "shaker", "amplitudes", "energies"):
        question = pipeline.library.question(QUIZ, name)
        assert isinstance(question, ScriptQuestion)
        plan = plan_exercise(question, pipeline.library.model_xml, SEED, pipeline.library.text)
        for trial in plan.trials:
            assert set(trial.inputs) == {"model", "start", "x", "claims"}
            assert trial.inputs["claims"] == [[claim.name, claim.form] for claim in trial.problem.claims]
            assert "Math" not in json.dumps(trial.inputs)


@pytest.mark.parametrize(
    ("change", "key", "why"),
    [
        ({"claims": [{**RATE, "expr": "data.qpos[7]"}]}, "check.claims.0", "look at its index"),
        ({"claims": [{**RATE, "expr": "data.qpos["}]}, "check.claims.0.expr", ""),
        ({"claims": [RATE, RATE]}, "check.claims", "one name"),
        ({"claims": [PLACE]}, "check.x", "axis"),
        ({"claims": [{**RATE, "form": "interval"}]}, "check.claims.0", "width"),
        ({"claims": [{**RATE, "quantity": "settling"}]}, "check.claims.0", "band"),
        ({"claims": [{**RATE, "quantity": "max"}]}, "check.claims.0", "remove `level`: with quantity max"),
        ({"claims": [{**RATE, "direction": "down"}]}, "check.claims.0", "only with crossing, crossings"),
        ({"claims": [{**RATE, "count": 3}]}, "check.claims.0", "remove `count`: with quantity decay_rate"),
        ({"claims": [{**RATE, "band": 0.1}]}, "check.claims.0", "only with settling"),
        (
            {"claims": [{**RATE, "instead": [{"expr": "data.qvel[9]", "what": "no"}]}]},
            "claims.0.instead.0.expr",
            "finite",
        ),
        ({"claims": [{**RATE, "instead": [{"expr": "nothing(", "what": "no"}]}]}, "claims.0.instead.0.expr", ""),
        (
            {"claims": [{**RATE, "formula": {"expr": "1 / 0", "text": "-", "why": "No."}}]},
            "claims.0.formula.expr",
            "finite",
        ),
        ({"claims": [RATE], "seconds": 1}, "check.claims.0", "no decay rate"),
        ({"claims": [RATE], "seconds": 60}, "check.seconds", "20000 steps"),
        ({"claims": [RATE], "controller": 1}, "check.controller", ""),
    ],
)
def test_a_claim_that_cannot_be_measured_is_a_fault(change: dict[str, Any], key: str, why: str) -> None:
    faults = check_exercise(pose(**change), lambda _: "", "q.json")
    assert any(fault.key.endswith(key) and why in fault.why for fault in faults), faults


def test_a_claim_that_one_case_alone_does_not_have_is_told_with_that_case() -> None:
    claim = {"name": "down", "quantity": "crossing", "expr": "data.qpos[0]", "level": -0.05, "direction": "down",
             "unit": "s"}  # fmt: skip
    cases: list[dict[str, Any]] = [
        {"id": "a", "xml": SPRING, "start": {"qpos": [0.1]}},
        {"id": "h", "hidden": True, "xml": SPRING, "start": {"qpos": [0.1]}, "set": {"damping": [0.8, 40]}},
    ]
    question = pose(
        claims=[claim], cases=cases, numbers={"damping": {"element": "joint[@name='x']", "attribute": "damping"}}
    )
    (fault,) = check_exercise(question, lambda _: "", "q.json")
    assert fault.key == "spring.check.claims.0"
    assert fault.why.startswith("case h, at the upper end of its ranges (damping = 40): the run has no crossing")
    question = pose(claims=[{**claim, "level": -5}], cases=[cases[0], {**cases[0], "id": "b"}])
    (fault,) = check_exercise(question, lambda _: "", "q.json")
    assert fault.why.startswith("the run has no crossing")  # of no case in particular


def test_every_claim_that_cannot_be_measured_is_told_at_once() -> None:
    claims = [{**RATE, "name": name, "expr": expr} for name, expr in (("a", "data.qpos[7]"), ("b", "data.qvel[9]"))]
    faults = check_exercise(pose(claims=[claims[0], RATE, claims[1]]), lambda _: "", "q.json")
    assert [fault.key for fault in faults] == ["spring.check.claims.0", "spring.check.claims.2"]


def test_a_claim_that_depends_on_the_timestep_is_refused_unless_the_author_says_so() -> None:
    stiff = SPRING.replace('integrator="RK4"', 'integrator="Euler"').replace("0.002", "0.05")
    claim = {**RATE, "name": "period", "quantity": "period", "unit": "s", "rtol": 0.001}
    (fault,) = certify_exercise(pose({"xml": stiff}, claims=[claim], seconds=12), lambda _: "", "q.json")
    assert "at the model's own timestep is off by" in fault.why
    for timestep in ("any", "given"):
        question = pose({"xml": stiff}, claims=[{**claim, "timestep": timestep}], seconds=12)
        assert certify_exercise(question, lambda _: "", "q.json") == []


def test_an_interval_may_hold_the_number_of_a_run_at_the_own_timestep() -> None:
    """Two neighbouring samples of such a run are what a learner has, and the limit may lie beyond them."""
    coarse = SPRING.replace('integrator="RK4"', 'integrator="Euler"').replace("0.002", "0.01")
    claim = {"name": "back", "quantity": "crossing", "expr": "data.qpos[0]", "level": 0.0, "direction": "down",
             "count": 2, "form": "interval", "width": 0.04, "unit": "s"}  # fmt: skip
    questions = {
        timestep: pose({"xml": coarse}, claims=[{**claim, "timestep": timestep}], seconds=2)
        for timestep in ("both", "any")
    }
    assert certify_exercise(questions["both"], lambda _: "", "q.json") == []
    model = mujoco.MjModel.from_xml_string(coarse)
    data = mujoco.MjData(model)
    data.qpos[0], samples = 0.1, [(0.0, 0.1)]
    while data.time < 2:
        mujoco.mj_step(model, data)
        samples.append((data.time, float(data.qpos[0])))
    pairs = [(t, u) for (t, x), (u, y) in pairwise(samples) if x >= 0 > y]
    (measured,) = measure_claims(plan_exercise(questions["both"], lambda _: "", 1).trials[0].problem)
    low, high = pairs[1]
    assert not low <= measured.values[0] <= high, "the limit lies in the bracket: the test shows nothing"
    assert diagnose(questions["both"], (low, high)) is None
    assert diagnose(questions["any"], (low, high)) is not None
    assert diagnose(questions["both"], (low - 0.02, high - 0.02)) is not None
    assert diagnose(questions["both"], (low + 0.03, high + 0.03)) is not None


def test_energies_of_the_last_state_and_of_the_step_before_are_right_at_the_given_timestep() -> None:
    """mj_step leaves data.energy of the state at which it began; who computes it from positions gets another one."""
    coarse = SPRING.replace("0.002", "0.02").replace("RK4", "Euler")
    claim = {
        "name": "e",
        "quantity": "final",
        "expr": "lib.energy().total",
        "unit": "J",
        "tol": 1e-4,
        "rtol": 0,
        "timestep": "given",
    }
    question = pose({"xml": coarse, "start": {"qpos": [1.0]}}, claims=[claim], seconds=1)
    model = mujoco.MjModel.from_xml_string(coarse)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(50):
        mujoco.mj_step(model, data)
    left, own = float(data.energy.sum()), float(25 * data.qpos[0] ** 2 + data.qvel[0] ** 2)
    assert abs(left - own) > 1e-2
    assert diagnose(question, left) is None
    assert diagnose(question, own) is None
    assert diagnose(question, (left + own) / 2) is not None


@pytest.mark.parametrize("timestep", ["both", "any", "given"])
def test_a_period_that_changes_during_the_run_is_a_fault(timestep: str) -> None:
    """A learner who measures the first wave, or the last, would get another number."""
    swing = SPRING.replace('gravity="0 0 0" ', "").replace('type="slide" stiffness="50"', 'axis="0 1 0" pos="0 0 1"')
    claim = {"name": "period", "quantity": "period", "expr": "data.qpos[0]", "unit": "s", "level": 0, "rtol": 0.001}
    case = {"xml": swing, "start": {"qpos": [2.0]}}
    question = pose(case, claims=[{**claim, "timestep": timestep}], seconds=8)
    (fault,) = certify_exercise(question, lambda _: "", "q.json")
    assert fault.key == "spring.check.claims.0" and "the period changes during the run" in fault.why


def test_a_settling_time_that_a_longer_run_denies_is_a_fault() -> None:
    creep = SPRING.replace('stiffness="50" damping="0.8"', 'stiffness="5" damping="20"')
    claim = {"name": "rest", "quantity": "settling", "expr": "data.qpos[0]", "unit": "s", "band": 0.01}
    (fault,) = certify_exercise(pose({"xml": creep}, claims=[claim]), lambda _: "", "q.json")
    assert fault.key == "spring.check.claims.0" and "it has not settled when the run ends" in fault.why
    assert certify_exercise(pose({"xml": creep}, claims=[{**claim, "level": 0}], seconds=11), lambda _: "", "") == []


def test_a_longer_run_that_breaks_is_a_fault_of_the_claim() -> None:
    claim = {"name": "rest", "quantity": "settling", "expr": "data.qpos[0]", "unit": "s", "band": 0.05, "level": 0,
             "controller": "data.qfrc_applied[0] = data.time > 7 ? 1e30 : 0"}  # fmt: skip
    (fault,) = certify_exercise(pose(claims=[claim]), lambda _: "", "q.json")
    assert fault.key == "spring.check.claims.0" and "reset" in fault.why


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"quantity": "period", "unit": "ms"}, "give `scale` 1000"),
        ({"quantity": "period", "unit": "ms", "scale": 1000}, None),
        ({"quantity": "period", "unit": "s"}, None),
        ({"quantity": "period", "unit": "m"}, "m measures something else"),
        ({"quantity": "frequency", "unit": "rad/s"}, "give `scale` 6.28318531"),
        ({"quantity": "frequency", "unit": "Hz"}, None),
        ({"quantity": "decay_rate", "unit": "1/s"}, None),
        ({"quantity": "max", "unit": "mm"}, "in m, and the unit is mm"),
        ({"quantity": "max", "unit": "mm", "scale": 1000}, None),
        ({"quantity": "max", "unit": "m"}, None),
        ({"quantity": "max", "unit": "N", "scale": 1000}, "which the unit N does not measure"),
        ({"quantity": "max", "unit": ""}, None),
        ({"quantity": "max", "unit": "N", "expr": "50 * data.qpos[0]"}, None),
        ({"quantity": "crossings", "unit": ""}, None),
    ],
)
def test_a_claim_that_is_not_in_its_unit_is_a_fault(change: dict[str, Any], why: str | None) -> None:
    """A learner who gives the period in ms, as the unit says, would be judged by seconds."""
    claim = {"name": "x", "expr": "data.qpos[0]", "rtol": 0.02, **change}
    faults = certify_exercise(pose(claims=[claim]), lambda _: "", "q.json")
    assert [fault.key for fault in faults] == ([] if why is None else ["spring.check.claims.0.unit"])
    assert why is None or why in faults[0].why


def test_a_claim_about_more_than_its_run_is_a_fault() -> None:
    claim = {"name": "x", "quantity": "max", "expr": "data.qpos[0]", "unit": "m"}
    assert certify_exercise(pose(claims=[{**claim, "until": 6}]), lambda _: "", "q.json") == []
    (fault,) = certify_exercise(pose(claims=[{**claim, "until": 7}]), lambda _: "", "q.json")
    assert (fault.key, "ends after 6 s" in fault.why) == ("spring.check.claims.0.until", True)


@dataclass
class Pair:
    b: Any
    a: Any


@dataclass(frozen=True, slots=True)
class Slots:
    b: Any
    a: Any


Named = namedtuple("Named", "b a")


@pytest.mark.parametrize(
    "returned",
    [
        {"a": 1, "b": 2},
        MappingProxyType({"b": 2, "a": 1}),
        UserDict(a=1, b=2),
        Pair(a=1, b=2),
        Slots(a=1, b=2),
        Named(a=1, b=2),
        (1, 2),
        [Fraction(1), np.float32(2)],
    ],
    ids=lambda returned: type(returned).__name__,
)
def test_values_are_read_by_name_from_whatever_has_names(returned: Any) -> None:
    separated = separate(name_values(returned), ["a", "b"])
    assert [to_numbers(value) for value in separated] == [1, 2]


def test_a_decimal_is_told_to_be_converted() -> None:
    plan = plan_exercise(pose(claims=[RATE]), lambda _: "", 1)
    results = {"other0": np.frombuffer(b"Decimal('0.2')", np.uint8)}
    told = "The function must return rate as a finite number: convert each Decimal by float(...) before you return it."
    assert CLAIMS.judge(plan.parameters, plan.trials[0], results).message == told


@pytest.mark.parametrize("value", [True, [True, Fraction(1)], "1", [1j], [object()], None, [Fraction(10) ** 400]])
def test_what_is_no_number_is_read_as_none(value: Any) -> None:
    assert to_numbers(value) is None
