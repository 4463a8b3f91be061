"""Reading a Runge-Kutta step off its trace: any tableau, from the probe of the lesson's own exercise."""

import marshal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from inspect import getsource
from io import BytesIO, TextIOWrapper
from itertools import combinations
from operator import sub
from statistics import median
from time import thread_time
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exercises.conftest import ROOT, Grade, model_xml, question, with_check
from grader.domain.run import RunReport
from grader.exercises import Plan, judge_exercise, load_kinds, plan_exercise
from grader.exercises.driving import embedding, recorder
from grader.exercises.kinds.rk4.combinations import System, Term, format_coefficient
from grader.exercises.kinds.rk4.judging import driver
from grader.exercises.kinds.rk4.judging.run import Problem
from grader.exercises.kinds.rk4.methods import GILL, NAMED, RALSTON, compute_order, repeat_classical
from grader.exercises.kinds.rk4.sentences.slopes import explain_slopes
from grader.exercises.kinds.rk4.sentences.states import (
    explain_missing_slope,
    explain_other_data,
    explain_unreadable_state,
)
from grader.exercises.kinds.rk4.step_trace import read_steps
from grader.exercises.kinds.rk4.tableau import (
    CLASSICAL,
    Matrix,
    Reading,
    draw_tableau,
    read_row,
    read_tableau,
    to_matrix,
)
from grader.exercises.trace import Note, Trace, read_trace
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail

STEP, FREE = question("rk4-step"), question("rk4-free-joint")
PROGRAMS = ROOT / "reference_solutions" / "1.3-exercises"
CLASSICAL_STEP = (PROGRAMS / "rk4-step" / "correct__classical.py").read_text()

Vector = np.ndarray[Any, np.dtype[np.float64]]
StepFunction = Callable[[mujoco.MjModel, mujoco.MjData], object]
Read = Callable[[StepFunction], Reading | None]


def problem_of(seed: int = 1) -> Problem:
    problem: Problem = plan_exercise(STEP, model_xml, seed).trials[0].problem
    return problem


@pytest.fixture(scope="module")
def read() -> Iterator[Read]:
    """Reads a step of this process, taped as in the jail, with two steps of the run."""
    originals = mujoco.mj_forward, mujoco.mj_forwardSkip
    problem = problem_of()
    inputs = problem.inputs() | {"runs": [{"timestep_s": problem.run.timestep_s, "steps": 2}]}
    driver.before_import()
    plain_note, driver.note = driver.note, recorder.note

    def read(step: StepFunction) -> Reading | None:
        recorder.state["left"] = recorder.BYTES_MAX
        recorder.begin(hidden=False)
        driver.trial([step], inputs, lambda *_: None)
        trace = read_trace(np.frombuffer(recorder.end(), np.uint8))
        return read_tableau(problem.run.scene().model, read_steps(trace, problem.run))

    yield read
    mujoco.mj_forward, mujoco.mj_forwardSkip, driver.note = *originals, plain_note


def step_of(rows: Matrix, positions: Matrix | None = None) -> StepFunction:
    """A step by a tableau; positions may have one of their own."""
    *stages, weights = rows
    *moves, ends = positions or rows

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        h, t, q, v = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy()
        velocities, slopes = list[Vector](), list[Vector]()
        for row, move in zip(stages, moves, strict=True):
            data.qpos[:] = q + h * sum((a * k for a, k in zip(move, velocities, strict=False)), np.zeros_like(q))
            data.qvel[:] = v + h * sum((a * k for a, k in zip(row, slopes, strict=False)), np.zeros_like(v))
            data.time = t + h * sum(row)
            mujoco.mj_forward(model, data)
            velocities.append(data.qvel.copy())
            slopes.append(data.qacc.copy())
        data.qpos[:] = q + h * sum(b * k for b, k in zip(ends, velocities, strict=True))
        data.qvel[:] = v + h * sum(b * k for b, k in zip(weights, slopes, strict=True))
        data.time = t + h

    return step


FRACTIONS = st.builds(lambda top, bottom: top / bottom, st.integers(1, 12), st.integers(1, 12))
SIGNED = st.builds(lambda size, sign: size * sign, FRACTIONS, st.sampled_from([-1, 1]))


@st.composite
def tableaus(draw: st.DrawFn) -> Matrix:
    """Stages that each use the one before, and weights that leave none out: so no other tableau is the same method."""
    stages = draw(st.integers(2, 7))
    rows = [[*draw(row_of(i - 1, st.just(0.0) | SIGNED)), draw(SIGNED)] for i in range(1, stages)]
    return [[], *rows, draw(row_of(stages, SIGNED))]


def row_of(size: int, numbers: st.SearchStrategy[float]) -> st.SearchStrategy[list[float]]:
    return st.lists(numbers, min_size=size, max_size=size)


@settings(max_examples=60)
@given(tableaus())
def test_any_tableau_is_read_off(read: Read, rows: Matrix) -> None:
    reading = read(step_of(rows))
    assert reading
    velocities, positions = to_matrix(reading.velocities, "a"), to_matrix(reading.positions, "v")
    assert velocities is not None
    assert positions is not None
    for given_row, row, other in zip(rows, velocities, positions, strict=True):
        np.testing.assert_allclose(row[: len(given_row)], given_row, atol=1e-7)
        np.testing.assert_allclose(other[: len(given_row)], given_row, atol=1e-7)


@settings(max_examples=20)
@given(tableaus(), st.data())
def test_positions_are_read_apart_from_velocities(read: Read, rows: Matrix, data: st.DataObject) -> None:
    own = [*rows[:-1], data.draw(row_of(len(rows) - 1, SIGNED))]
    reading = read(step_of(rows, own))
    assert reading
    positions = to_matrix(reading.positions, "v")
    assert positions is not None
    np.testing.assert_allclose(positions[-1], own[-1], atol=1e-7)


@pytest.mark.parametrize("name", NAMED)
def test_a_named_method_is_named(name: str, read: Read) -> None:
    reading = read(step_of(NAMED[name]))
    assert reading
    assert name in (explain_slopes(reading, ()) or "")


def test_a_multiple_of_h_without_its_slope_is_named(read: Read) -> None:
    def step(model: mujoco.MjModel, data: mujoco.MjData, number: float) -> None:
        h, q, v = model.opt.timestep, data.qpos.copy(), data.qvel.copy()
        slopes = list[Vector]()
        velocities = list[Vector]()
        for c in (0, 1 / 2, 1 / 2, 1):
            first = len(slopes) == 1
            data.qpos[:] = q + c * h * (number if first else velocities[-1] if slopes else 0)
            data.qvel[:] = v + c * h * (slopes[-1] if slopes else 0)
            mujoco.mj_forward(model, data)
            slopes.append(data.qacc.copy())
            velocities.append(data.qvel.copy())
        data.qpos[:] = q + h * (velocities[0] + 2 * velocities[1] + 2 * velocities[2] + velocities[3]) / 6
        data.qvel[:] = v + h * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3]) / 6

    reading = read(partial(step, number=1))
    assert reading
    assert "Your stage 2 adds the same number, h/2, to every position" in (explain_missing_slope(reading) or "")
    for rows in (CLASSICAL, [*CLASSICAL[:-1], (1 / 4,) * 4]):  # near misses: right, and other weights
        other = read(step_of(rows))
        assert other
        assert explain_missing_slope(other) is None
    resting = read(partial(step, number=0))
    assert resting
    assert explain_missing_slope(resting) is None


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        ((0.167, 0.333, 0.333, 0.167), "Your weights are 0.167, 0.333, 0.333, 0.167, which is 1/6 and 1/3 rounded"),
        ((6, 12, 12, 6), "are multiplied by 6, not divided by 6"),
        ((1 / 8, 1 / 4, 1 / 4, 1 / 8), "are divided by 8, not by 6"),
        ((1 / 6, 1 / 3, 1 / 4, 1 / 4), "Your weights are 1/6, 1/3, 1/4, 1/4;"),
    ],
)
def test_wrong_weights_are_told_apart(weights: tuple[float, ...], said: str, read: Read) -> None:
    reading = read(step_of([*CLASSICAL[:-1], weights]))
    assert reading
    assert said in (explain_slopes(reading, ()) or "")


WRONG_ROWS = {
    2: ((1 / 3,), "Your stage 2 moves by h/3 k1;"),
    3: ((0, 1), "Your stage 3 is evaluated at the end"),
    4: ((0, 0, 1 / 2), "Your last stage is evaluated at half the step"),
    5: ((1 / 6, 1 / 3, 1 / 6, 1 / 6), "Your weights are 1/6, 1/3, 1/6, 1/6 and sum to 5/6"),
}


@pytest.mark.parametrize("wrong", [rows for size in (2, 3, 4) for rows in combinations(WRONG_ROWS, size)])
def test_every_wrong_row_of_a_step_is_counted_and_three_are_named(wrong: tuple[int, ...], read: Read) -> None:
    rows = [WRONG_ROWS[row][0] if row in wrong else right for row, right in enumerate(CLASSICAL, 1)]
    reading = read(step_of(rows))
    assert reading
    sentence = explain_slopes(reading, ()) or ""
    assert sentence.startswith(("Two things are wrong. First: ", "Three things", "Four things")[len(wrong) - 2])
    places = [sentence.index(WRONG_ROWS[row][1]) for row in wrong[:3]]
    assert places == sorted(places)


def test_stages_that_are_too_near_by_one_ratio_are_one_mistake(read: Read) -> None:
    reading = read(step_of([(), (1 / 3,), (0, 1 / 3), *CLASSICAL[3:]]))
    assert reading
    assert (explain_slopes(reading, ()) or "").startswith("Your stages 2 and 3 lie 2/3 times as far from the start")


def test_a_row_that_is_wrong_for_positions_alone_is_told_apart(read: Read) -> None:
    stage, weights = (0, 1 / 3), WRONG_ROWS[5][0]
    reading = read(step_of([*CLASSICAL[:-1], weights], [*CLASSICAL[:2], stage, *CLASSICAL[3:]]))
    assert reading
    sentence = explain_slopes(reading, ()) or ""
    assert "First: In your stage 3, the position moves by h/3 k2;" in sentence
    assert "Second: For the velocity, your weights are 1/6, 1/3, 1/6, 1/6" in sentence


STAGES_AND_REST = """import mujoco

def rk4_step(model, data):
    h, t, q, v, a = model.opt.timestep, data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()
    def slope():
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
    ks = [slope()]
    for c, time in ((0.5, t + h / 2), (0.5, t + h / 2), (1, {time})):
        data.qpos[:] = q + c * h * ks[-1][0]
        data.qvel[:] = v + c * h * ks[-1][1]
        data.act[:] = a + {act} * ks[-1][2]
        data.time = time
        ks.append(slope())
    w = ({weights})
    data.qpos[:] = q + h / 6 * sum(b * k[0] for b, k in zip(w, ks))
    data.qvel[:] = v + h / 6 * sum(b * k[1] for b, k in zip(w, ks))
    data.act[:] = a + h / 6 * sum(b * k[2] for b, k in zip((1, 2, 2, 1), ks))
    data.time = t + h
"""


@pytest.mark.parametrize(
    ("changes", "rest"),
    [
        ({"time": "t + h / 2"}, "Apart from that: data.time is t + h/2 when stage 4 is evaluated"),
        ({"act": "0"}, "Apart from that: data.act stands at the start of the step in all your stages"),
        ({}, None),
    ],
)
def test_what_else_is_wrong_is_said_and_the_line_is_that_of_the_first(
    changes: dict[str, str], rest: str | None, grade: Grade
) -> None:
    texts = {"time": "t + h", "act": "c * h", "weights": "1, 2, 2, 2"} | changes
    verdict = grade(STEP, STAGES_AND_REST.format(**texts))
    said = verdict.diagnosis or ""
    assert said.startswith("Your weights are 1/6, 1/3, 1/3, 1/3 and sum to 7/6")
    assert rest in said if rest else "Apart" not in said
    assert verdict.line == 16, "the sum, not the stage whose time is wrong"


@pytest.mark.parametrize(
    ("program", "marked"),
    [
        ("accelerations_are_views", "return v, data.qacc, data.act_dot.copy()"),
        ("velocity_aliases_data", "t0, q0, v0, act0 = data.time, data.qpos.copy(), data.qvel, data.act.copy()"),
        ("weights_over_four", "q, v, act = ("),
        ("stage_three_from_both", "k3 = slope(q0 + h / 4 * (k1[0] + k2[0]), "),
    ],
)
def test_the_line_is_where_the_mistake_stands_not_where_its_result_is_written(
    program: str, marked: str, grade: Grade
) -> None:
    source = (PROGRAMS / "rk4-step" / f"incorrect__{program}.py").read_text()
    line = grade(STEP, source).line
    assert line is not None
    assert source.splitlines()[line - 1].strip().startswith(marked)


def test_another_data_is_named_where_the_steps_begin_at_several_states(read: Read) -> None:
    def elsewhere(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mine = mujoco.MjData(model)
        for _ in range(4):
            mujoco.mj_forward(model, mine)
        data.qvel[:] += model.opt.timestep * mine.qacc
        data.qpos[:] += model.opt.timestep * data.qvel

    steps = read(elsewhere)
    assert steps
    assert "you pass it another data" in (explain_other_data(steps) or "")
    for step in (step_of(CLASSICAL), step_of([[], [0.0], [1 / 2, 1 / 2]])):  # near misses: right, state never written
        other = read(step)
        assert other
        assert explain_other_data(other) is None


def test_the_order_of_a_tableau_is_that_of_the_books() -> None:
    orders = [compute_order(rows) for rows in NAMED.values()]
    assert orders == [1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4]
    assert compute_order(CLASSICAL) == compute_order(RALSTON) == compute_order(GILL) == 4
    assert compute_order(repeat_classical(2, 0.5)) == 4
    assert compute_order([*CLASSICAL[:-1], (1 / 8, 3 / 8, 3 / 8, 1 / 8)]) < 4
    butcher = [
        [],
        [1 / 4],
        [1 / 8, 1 / 8],
        [0, -1 / 2, 1],
        [3 / 16, 0, 0, 9 / 16],
        [-3 / 7, 2 / 7, 12 / 7, -12 / 7, 8 / 7],
        [7 / 90, 0, 32 / 90, 12 / 90, 32 / 90, 7 / 90],
    ]
    assert compute_order(butcher) == 5


def test_the_picture_holds_both_tableaus_as_fractions_and_what_differs(read: Read) -> None:
    reading = read(step_of([(), (1 / 2,), (1 / 2, 0), (0, 0, 1), (1 / 6, 1 / 3, 1 / 3, 1 / 6)]))
    assert reading
    picture = draw_tableau(reading)
    assert picture
    assert picture["of"] == "positions and velocities"
    assert picture["given"]["a"] == [[], ["1/2"], ["1/2", "0"], ["0", "0", "1"]]
    assert picture["given"]["b"] == picture["asked"]["b"] == ["1/6", "1/3", "1/3", "1/6"]
    assert picture["asked"]["c"] == ["0", "1/2", "1/2", "1"]
    assert picture["wrong"] == [["a", 2, 0], ["a", 2, 1]]


@pytest.mark.parametrize(
    ("value", "text"),
    [(1 / 3, "1/3"), (-2.0, "-2"), (0.0, "0"), (64448 / 6561, "64448/6561"), (2**0.5, "1.4142"), (1e-14, "0")],
)
def test_coefficients_are_written_as_fractions(value: float, text: str) -> None:
    assert format_coefficient(value) == text


@pytest.mark.parametrize("power", [0, 2])
def test_a_power_of_h_is_told_by_the_fewest_terms(power: int) -> None:
    """Steps of two lengths: h and 1 give whatever h and h * h give, and the round-off of slopes that diverge."""
    rng = np.random.default_rng(5)
    h = np.repeat([0.002, 0.0025, 0.002, 0.0025], 4)
    slopes = rng.normal(size=(4, len(h))) * np.array([[1e1], [1e3], [1e5], [1e7]])
    weights = {Term("a", 1): 1 / 6} | {Term("a", stage, power): float(stage) for stage in (2, 3, 4)}
    change = np.sum([value * h**term.power * slopes[term.stage - 1] for term, value in weights.items()], axis=0)
    terms = {Term("a", stage, p): h**p * slopes[stage - 1] for stage in (1, 2, 3, 4) for p in (0, 1, 2)}
    system = System(change, np.full(len(h), 1e-12 * np.max(np.abs(change))), terms)
    assert read_row(system, "a", 5, 4, ()) == pytest.approx(weights, rel=1e-4)


def test_a_state_of_no_known_form_is_said_to_be_one(read: Read) -> None:
    def odd(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        step_of(CLASSICAL)(model, data)
        data.qvel += np.sin(data.qpos)

    reading = read(odd)
    assert reading
    assert explain_slopes(reading, ()) is None
    assert (explain_unreadable_state(reading) or "").startswith("The velocities at the end of your step are not")


NUMBERS = st.sampled_from([0.0, 1.0, -1.0, 0.002, 1e8, 1e-300, np.nan, np.inf]) | st.floats()


@settings(max_examples=100)
@given(st.integers(0, 5), st.lists(NUMBERS, min_size=1, max_size=12), st.floats(), st.booleans())
def test_forged_steps_never_raise(calls: int, numbers: Sequence[float], timestep: float, probe: bool) -> None:
    plan = plan_exercise(STEP, model_xml, 1)
    problem = plan.trials[0].problem
    size = 1 + 2 + 2 + 0 + 0 + 2 + calls * (1 + 4 + 4) + 5
    note = Note("step", {}, np.array([calls, probe, timestep, *np.resize(np.array(numbers), size)]))
    for notes in ((note,), (note, note, note)):
        steps = read_steps(Trace(notes), problem.run)
        with np.errstate(all="ignore"):
            reading = read_tableau(problem.run.scene().model, steps)
        assert reading is None or explain_slopes(reading, ()) is None or isinstance(explain_slopes(reading, ()), str)
        if reading:
            draw_tableau(reading)
            explain_unreadable_state(reading)


@pytest.mark.parametrize("head", [(-1, 0, 0.002), (0.5, 0, 0.002), (1e8, 0, 0.002), (0, 0, 0), (1, 0, 0.002), ()])
def test_a_step_that_cannot_be_read_is_left_out(head: Sequence[float]) -> None:
    note = Note("step", {}, np.array([*head, *np.zeros(12)]))
    assert read_steps(Trace((note,)), problem_of().run) == []


TIMESTEP = "    h = model.opt.timestep\n"
PRINTS = CLASSICAL_STEP.replace(TIMESTEP, f"{TIMESTEP}    print(round(h, 9))\n")


def test_the_probe_prints_nothing_and_leaves_no_result(grade: Grade, run: Callable[..., RunReport]) -> None:
    report = run(STEP, PRINTS)
    plan = plan_exercise(STEP, model_xml, 1)
    runs = [run for trial in plan.trials if not trial.hidden for run in trial.problem.runs]
    assert report.stdout.split() == [str(one.timestep_s) for one in runs for _ in range(one.steps)]
    assert judge_exercise(STEP, plan, report).status == "correct"


SEARCHES = (
    CLASSICAL_STEP.replace("def rk4_step(model, data)", "def classical(model, data, h)").replace(TIMESTEP, "")
    + '''

def rk4_step(model, data):
    """Halves the step until two results agree, however long that takes."""
    start = data.time, data.qpos.copy(), data.qvel.copy(), data.act.copy()
    parts, last = 1, None
    while True:
        data.time, data.qpos[:], data.qvel[:], data.act[:] = start
        for _ in range(parts):
            classical(model, data, model.opt.timestep / parts)
        if last is not None and abs(data.qvel - last).max() < 1e-9:
            return
        parts, last = 2 * parts, data.qvel.copy()
'''
)


def test_code_that_chooses_its_own_substeps_ends(run: Callable[..., RunReport]) -> None:
    case = {"id": "a", "model": "double_pendulum", "start": {"key": "release"}, "steps": 50}
    report = run(with_check(STEP, cases=[case], order=None), SEARCHES)
    assert report.status == "returned"
    assert len(report.results["t0_q0"]) == case["steps"]


RAISES = (
    CLASSICAL_STEP.rstrip()
    + """
    if abs(h - 0.0025) < 1e-9:
        raise RuntimeError("odd")
"""
)


UNUSED = f"import scipy.integrate\n{CLASSICAL_STEP.rstrip()}\n    data.qvel[:] += 1e-3 * data.qpos**2\n"


def test_scipy_that_is_imported_and_takes_no_step_is_not_blamed(grade: Grade) -> None:
    verdict = grade(STEP, UNUSED)
    assert verdict.status == "incorrect"
    assert "scipy" not in (verdict.diagnosis or "")


def test_what_is_raised_in_the_probe_does_not_count(grade: Grade) -> None:
    verdict = grade(STEP, RAISES)
    assert verdict.status == "correct"
    assert verdict.evidence["tableau"]["given"]["b"] == ["1/6", "1/3", "1/3", "1/6"], "what came before is kept"


SILENT = """
def note(*_):
    return False


def begin(hidden):
    pass


def end():
    return b""


def traced(function):
    return function
"""
"""A recorder that records nothing."""

ROUNDS, TURNS, STEPS = 4, 60, 18
"""`STEPS`: of the shortened runs, in which every step that a whole run notes is noted too."""
COST_MAX = 0.0125
"""Measured: 0.73 to 0.97 %, a hundredth as is asked; another machine's ratio may differ by a quarter. Loading the
recorder takes 0.2 ms, a trial 20 to 40 us, the probe 0.4 ms."""


def silent(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> Plan:
    """The same plan without any recording."""
    with monkeypatch.context() as patch:
        patch.setattr(embedding, "getsource", lambda module: SILENT if module is recorder else getsource(module))
        quiet = embedding.compile_driver(load_kinds()["rk4"].driver)
    return replace(plan, codes=quiet, inputs=untaped(plan.inputs), hidden_inputs=untaped(plan.hidden_inputs))


def untaped(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The same inputs, so that no step is noted."""
    trials = [{**trial, "inputs": {**trial["inputs"], "taped": False}} for trial in inputs["trials"]]
    for one in trials:
        one["inputs"].pop("probe", None)
    return {**inputs, "trials": trials}


def shortened(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The same inputs with short runs, and none where no step is noted: the trace costs as much, and stands out."""
    trials = [{**trial, "inputs": {**trial["inputs"]}} for trial in inputs["trials"]]
    for one in trials:
        runs = one["inputs"]["runs"] if len(one["inputs"]["runs"]) == 1 else []
        one["inputs"]["runs"] = [run | {"steps": min(run["steps"], STEPS)} for run in runs]
    return {**inputs, "trials": trials}


def shortly(plan: Plan) -> Plan:
    return replace(plan, inputs=shortened(plan.inputs), hidden_inputs=shortened(plan.hidden_inputs))


def run_here(plan: Plan, source: str) -> Callable[[], float]:
    """Returns what runs the trials of a plan in this process and returns their CPU time. What else a run in the jail
    takes differs from run to run by more than a trace."""
    codes = {name: marshal.loads(code) for name, code in plan.codes.items()}
    student, parts = ModuleType("student"), (plan.inputs, plan.hidden_inputs)

    def run() -> float:
        with pytest.MonkeyPatch.context() as patch:
            for name in ("mj_forward", "mj_forwardSkip"):
                patch.setattr(mujoco, name, getattr(mujoco, name))  # a driver replaces them
            patch.setattr(sys, "stdout", TextIOWrapper(BytesIO()))  # a recorder listens to it
            begin, names = thread_time(), dict[str, Any]()
            exec(codes["harness"], names)
            names["load"](codes["recorder"], codes["kind"])
            loaded = thread_time()
            exec(compile(source, "student.py", "exec"), vars(student))
            imported = thread_time()
            for part in parts:
                names["take_models"](part)
                names["attempt_all"](student, part["trials"], lambda *_: None, "traces")
            return thread_time() - imported + loaded - begin

    return run


@pytest.mark.cost
@pytest.mark.parametrize(
    ("exercise", "program"),
    [(STEP, "correct__classical"), (FREE, "correct__one_mj_integratepos"), (FREE, "correct__quaternion_derivative")],
    ids=lambda value: getattr(value, "id", value),
)
def test_the_trace_costs_a_hundredth_of_the_runs_cpu_time(
    exercise: ScriptQuestion, program: str, jail: Jail, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Short runs with and without take turns, beside whole runs in the jail without. The difference of neighbours
    counts: the machine's clock drifts by more than a trace costs."""
    source = (PROGRAMS / exercise.id / f"{program}.py").read_text()
    plan = plan_exercise(exercise, model_xml, 1)
    quiet = silent(plan, monkeypatch)
    traced, untraced = (run_here(one, source) for one in (shortly(plan), shortly(quiet)))
    whole = quiet.build_job(source, exercise.limits)
    spent: dict[str, list[float]] = {"traced": [], "untraced": [], "whole": []}
    for turn in range(ROUNDS * TURNS):
        spent["traced"].append(traced())
        spent["untraced"].append(untraced())
        if turn % 10 == 0:
            spent["whole"].append(jail.run(whole).cpu_s)
        extra = median(map(sub, spent["traced"], spent["untraced"]))
        share = extra / median(spent["whole"])
        if (turn + 1) % TURNS == 0 and share <= COST_MAX:
            break
    assert 0 < share <= COST_MAX, {name: median(times) for name, times in spent.items()}


def test_all_traces_of_a_run_are_small(run: Callable[..., RunReport]) -> None:
    for exercise, program in ((STEP, "correct__classical"), (FREE, "correct__rotation_vector")):
        report = run(exercise, (PROGRAMS / exercise.id / f"{program}.py").read_text())
        sizes = [report.results["traces"].nbytes, report.hidden_results["hidden_traces"].nbytes]
        assert sum(sizes) < recorder.BYTES_MAX / 4
