"""Mutants of the right step: each is recognised in the trace of a function that takes its steps."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exercises.conftest import model_xml, question
from grader.exercises import plan_exercise
from grader.exercises.driving import recorder
from grader.exercises.kinds.rk4.judging import driver
from grader.exercises.kinds.rk4.judging.run import Problem
from grader.exercises.kinds.rk4.lines import END, StepPlace, find_line
from grader.exercises.kinds.rk4.mutants.catalogue import MUTANTS, OF_BARE_DATA, RIGHT, Mutant, combine
from grader.exercises.kinds.rk4.mutants.matching import TakenSteps, find_match
from grader.exercises.kinds.rk4.mutants.program import StepProgram, take_step
from grader.exercises.kinds.rk4.step_trace import read_steps
from grader.exercises.trace import Note, Trace, read_trace

Take = Callable[[str, Callable[..., object]], Trace]
CASES = {"rk4-step": ("double-pendulum", "activation", "joint-limit"), "rk4-free-joint": ("free-body",)}


def pose(name: str) -> dict[str, Problem]:
    trials = plan_exercise(question(name), model_xml, 1).trials
    return {trial.id: trial.problem for trial in trials if trial.id in CASES[name]}


PROBLEMS = {case: problem for name in CASES for case, problem in pose(name).items()}


@pytest.fixture(scope="module")
def take() -> Iterator[Take]:
    """Tapes a function's steps on a case in this process, as in the jail."""
    originals = mujoco.mj_forward, mujoco.mj_forwardSkip
    driver.before_import()
    plain_note, driver.note = driver.note, recorder.note

    def take(case: str, step: Callable[..., object]) -> Trace:
        problem = PROBLEMS[case]
        recorder.state["left"] = recorder.BYTES_MAX
        recorder.begin(hidden=False)
        inputs = problem.inputs() | {"runs": [{"timestep_s": problem.run.timestep_s, "steps": 2}]}
        driver.trial([step], inputs, lambda *_: None)
        return read_trace(np.frombuffer(recorder.end(), np.uint8))

    yield take
    mujoco.mj_forward, mujoco.mj_forwardSkip, driver.note = *originals, plain_note


def as_function(program: StepProgram) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """A program as a student writes it: it calls mujoco.mj_forward."""

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        def call() -> None:
            for name in program.bare_data:
                setattr(data, name, 0.0) if name == "time" else getattr(data, name).fill(0.0)
            mujoco.mj_forward(model, data)

        take_step(program, model, data, call)

    return step


def read_taken(case: str, trace: Trace) -> TakenSteps:
    problem = PROBLEMS[case]
    steps = read_steps(trace, problem.run)
    assert steps
    assert problem.probe is not None or not any(step.probe for step in steps)
    probe = problem.probe.force if problem.probe else problem.run.force
    return TakenSteps(problem.run.scene().model, [(step, probe if step.probe else problem.run.force) for step in steps])


def shows(mutant: Mutant, case: str) -> bool:
    """Whether a mutant differs from the right step on the model of a case."""
    model = PROBLEMS[case].run.scene().model
    of_rotations = {"rate", "move"} & mutant.changes.keys()
    of_activations = mutant.changes.keys() <= {"reach_a", "weights_a"} or "act" in mutant.changes.get("bare_data", ())
    if of_rotations:
        return bool(model.nq > model.nv)
    if mutant.changes.get("clips"):
        return bool(model.jnt_limited.any())
    return bool(not (of_activations or "bare_data" in mutant.changes) or model.na)


@pytest.mark.parametrize("case", ["double-pendulum", "free-body", "activation"])
def test_every_mutant_is_recognised_by_its_steps(case: str, take: Take) -> None:
    for mutant in MUTANTS[:: 11 if case != "activation" else 5]:
        if not shows(mutant, case) or "accelerate" in mutant.changes:
            continue
        taken = read_taken(case, take(case, as_function(mutant.program)))
        match = find_match([taken])
        assert match is not None, mutant.sentence
        if match.mutants:  # two mutants may be one on a model; then either is true
            assert len(match.mutants) == 1, mutant.sentence


@pytest.mark.parametrize("case", PROBLEMS)
def test_the_right_step_is_no_mutant(case: str, take: Take) -> None:
    match = find_match([read_taken(case, take(case, as_function(RIGHT)))])
    assert match is not None
    assert match.mutants == ()


def test_a_missing_call_is_not_told_as_another_tableau(take: Take) -> None:
    mutant = next(one for one in MUTANTS if one.changes == {"calls": (True, True, False, True)})
    match = find_match([read_taken("double-pendulum", take("double-pendulum", as_function(mutant.program)))])
    assert match is not None
    assert match.sentence.startswith("In your stage 3 mj_forward is not called")


@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_two_mutants_are_both_told(data: st.DataObject, take: Take) -> None:
    calls = [mutant for mutant in MUTANTS if mutant.changes.keys() == {"calls"} and sum(mutant.changes["calls"]) == 3]
    times = [mutant for mutant in MUTANTS if mutant.changes.keys() == {"times"}]
    first, second = data.draw(st.sampled_from(calls)), data.draw(st.sampled_from(times))
    program = combine(first, second)
    assert program is not None
    match = find_match([read_taken("double-pendulum", take("double-pendulum", as_function(program)))])
    assert match is not None
    if len(match.mutants) == 2:
        assert {mutant.sentence for mutant in match.mutants} & {first.sentence, second.sentence}
        assert match.sentence.startswith("Two things are wrong. First: ")


def test_of_two_mutants_the_one_that_comes_first_in_the_step_is_told_first(take: Take) -> None:
    missing = next(mutant for mutant in MUTANTS if mutant.changes == {"calls": (True, True, False, True)})
    time = next(mutant for mutant in MUTANTS if mutant.changes.get("times") == (0.0, 0.5, 0.5, 1.0, 2.0))
    program = combine(missing, time)
    assert program is not None
    match = find_match([read_taken("double-pendulum", take("double-pendulum", as_function(program)))])
    assert match is not None
    assert match.mutants == (missing, time)


def test_mutants_that_change_the_same_entry_are_not_combined() -> None:
    one, other = (
        m for m in MUTANTS if m.changes.get("times") in ((0.5, 0.5, 0.5, 1.0, 1.0), (1.0, 0.5, 0.5, 1.0, 1.0))
    )
    assert combine(one, other) is None


def test_the_work_is_bounded_by_a_count_of_steps(take: Take, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grader.exercises.kinds.rk4.mutants.matching.STEPS_MAX", 0)
    program = combine(MUTANTS[1], next(mutant for mutant in MUTANTS if mutant.changes.keys() == {"times"}))
    assert program is not None
    assert find_match([read_taken("double-pendulum", take("double-pendulum", as_function(program)))]) is None


def test_no_mutant_is_the_right_step_and_none_is_there_twice() -> None:
    programs = [mutant.program for mutant in MUTANTS]
    assert RIGHT not in programs
    assert len({*programs}) == len(programs) > 200
    assert {replace(RIGHT, **mutant.changes) for mutant in OF_BARE_DATA} < {*programs}


def rows(*changes: tuple[int, ...]) -> Trace:
    return Trace((Note("lines", {}, np.array(changes, dtype=np.float64).reshape(-1)),))


Q, V, CALL = 1, 2, 16


@pytest.mark.parametrize(
    ("place", "line"),
    [
        (StepPlace(1, "qpos", 2), 12), (StepPlace(1, "qvel", 2), 13), (StepPlace(0, "forward", 2), 10),
        (StepPlace(END, "qpos", 2), 20), (StepPlace(END, "act", 2), None), (StepPlace(1, "qpos", 3), None),
    ],
)  # fmt: skip
def test_a_place_in_a_step_has_the_line_that_writes_it(place: StepPlace, line: int | None) -> None:
    trace = rows((CALL, 10, 0, 0), (Q, 12, 0, 0), (V, 13, 0, 0), (CALL, 14, 0, 0), (Q, 20, 0, 0))
    assert find_line(trace, place) == line


def test_of_a_line_that_the_stages_share_the_calling_line_is_told() -> None:
    trace = rows((CALL, 5, 10, 0), (Q, 4, 11, 0), (CALL, 5, 11, 0), (Q, 4, 12, 0), (CALL, 5, 12, 0), (Q, 20, 0, 0))
    assert find_line(trace, StepPlace(1, "qpos", 3)) == 11
    assert find_line(trace, StepPlace(2, "qpos", 3)) == 12


@given(
    st.lists(st.floats(allow_nan=True), max_size=24), st.integers(-2, 9), st.sampled_from(["qpos", "time", "forward"])
)
def test_forged_lines_never_raise(numbers: list[float], after: int, part: str) -> None:
    trace = Trace((Note("lines", {}, np.array(numbers, dtype=np.float64)),))
    line = find_line(trace, StepPlace(after, part, max(after, 1)))
    assert line is None or float(line) in numbers


def test_a_changed_model_is_noted_by_its_fields(take: Take) -> None:
    def halve(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        as_function(RIGHT)(model, data)
        model.opt.timestep /= 2
        model.dof_damping[:] += 1

    (note,) = take("double-pendulum", halve).list_notes("changed")
    assert note.info["fields"] == ["model.dof_damping", "model.opt.timestep"]
    assert note.numbers.tolist() == [0.5]
    assert not take("double-pendulum", as_function(RIGHT)).list_notes("changed")
