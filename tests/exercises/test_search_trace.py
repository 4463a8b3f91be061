"""The trace of a search: what it says of the runs, and that it decides nothing."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.exercises.crashes import explain_hidden_slip
from grader.exercises.kind import JudgedTrial, Trial
from grader.exercises.kinds.threshold.bisections import explain_wrong_bisection
from grader.exercises.kinds.threshold.judging import driver
from grader.exercises.kinds.threshold.judging.judge import Bracket, Claim, NoLimit, bracket_around, judge_claim
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.exercises.kinds.threshold.search import (
    CERTAIN_RULES,
    FALLBACK_RULES,
    NO_STEP_RULES,
    explain_searches,
)
from grader.exercises.kinds.threshold.search_trace import COLUMNS, read_search
from grader.exercises.trace import HandledException, Note, Trace
from grader.numerics.integrators import EULER, IMPLICITFAST

MODEL = (Path(__file__).parents[2] / "models/pendulum_servo.xml").read_text().replace('kp="100"', 'kp="2000"')
PARAMETERS = ThresholdParameters.model_validate(
    {
        "model": "pendulum_servo",
        "start": {"hinge": 1.0},
        "integrators": ["Euler", "implicitfast"],
        "cases": [{"id": "a"}],
    }
)
START = (("hinge", 1.0),)
ALL_RULES = (CERTAIN_RULES, NO_STEP_RULES, FALLBACK_RULES)
BADQACC = 1 << 5


def run(
    h: float,
    *,
    end: float = 3.0,
    warnings: int = 0,
    integrator: int = 0,
    start: float = 1.0,
    old_warnings: int = 0,
    model: int = 0,
    last: float | None = None,
    ctrl: float = 0.0,
) -> list[float]:
    return [model, h, integrator, 0.0, start, 0.0, old_warnings, ctrl, end, warnings, h if last is None else last]


def trace_of(
    *runs: list[float],
    other_functions: tuple[str, ...] = (),
    differing_fields: tuple[list[str], ...] = ([],),
    created: int = 0,
) -> Trace:
    info = {"total": len(runs), "created": created, "models": list(differing_fields), "given": 0, "set_s": 0.002}
    info["others"] = list(other_functions)
    return Trace((Note("search", info, np.array(runs, dtype=np.float64).reshape(-1)),))


def judged(claim: Claim, trace: Trace, *, hidden: bool = False, code: int = EULER.code) -> JudgedTrial[Cell, Claim]:
    cell = Cell("a", MODEL, MODEL, START, IMPLICITFAST if code == IMPLICITFAST.code else EULER)
    judgement = judge_claim(PARAMETERS, cell, claim)
    return JudgedTrial(Trial("a.Euler", {}, cell, hidden=hidden), judgement, False, trace)


def told(claim: Claim, trace: Trace, *, hidden: bool = False, code: int = EULER.code) -> str:
    wrong = [judged(claim, trace, hidden=hidden, code=code)]
    return next((one for rules in ALL_RULES if (one := explain_searches(PARAMETERS, wrong, rules, wrong))), "")


LOW = Bracket(0.005, 0.0054)
HIGH = Bracket(0.03, 0.0304)


@pytest.mark.parametrize(
    ("claim", "trace", "said"),
    [
        (NoLimit(), trace_of(), "without a single step"),
        (NoLimit(), trace_of(created=1), "but mj_step is not called"),
        (HIGH, trace_of(), "Nothing was simulated"),
        (HIGH, trace_of(other_functions=("mjd_transitionFD",)), ""),
        (NoLimit(), trace_of(run(0.002), run(0.002)), "timestep of 2 ms"),
        (NoLimit(), trace_of(run(0.002)), "Your only run"),
        (LOW, trace_of(run(0.001, end=0.5), run(0.005, end=0.5), run(0.0054, warnings=BADQACC)), "0.5 s"),
        (LOW, trace_of(run(0.004, end=0.2), run(0.005, end=0.25), run(0.0054, warnings=BADQACC)), "50 steps"),
        (
            HIGH,
            trace_of(run(0.001), run(0.03, warnings=BADQACC), run(0.0304, warnings=BADQACC)),
            "At 30 ms MuJoCo raised BADQACC",
        ),
        (NoLimit(), trace_of(run(0.05, warnings=BADQACC)), "At 50 ms MuJoCo raised BADQACC"),
        (NoLimit(), trace_of(run(0.001), run(0.03)), "Your search ends at 30 ms"),
        (LOW, trace_of(run(0.005), run(0.0054), run(0.05, warnings=BADQACC)), "raised no warning within 3 s"),
        (
            LOW,
            trace_of(run(0.005), run(0.0054, end=0.4), run(0.05, warnings=BADQACC)),
            "within 0.4 s, where you ended it",
        ),
        (LOW, trace_of(run(0.0048), run(0.0055, warnings=BADQACC)), "never ran it"),
        (Bracket(0.005, 5.4), trace_of(run(0.005), run(0.0054, warnings=BADQACC)), "it is in milliseconds"),
        (LOW, trace_of(run(0.005), run(0.0054, warnings=BADQACC, old_warnings=BADQACC)), "still stood"),
        (NoLimit(), trace_of(run(0.001, start=0.0), run(0.05, start=0.0)), "Start with hinge at 1 rad"),
        (LOW, trace_of(run(0.001), run(0.005, start=0.3), run(0.0054, warnings=BADQACC)), "Only your first run"),
        (LOW, trace_of(run(0.005, start=0.02), run(0.0054, start=0.02)), "start with hinge at 0.02 rad, not at 1 rad"),
        (LOW, trace_of(run(0.005, ctrl=1.0), run(0.0054, ctrl=1.0)), "set data.ctrl[0] to 1"),
        (LOW, trace_of(run(0.005), run(0.02, warnings=BADQACC)), "too coarse"),
        (Bracket(0.03, 0.03), trace_of(run(0.0252), run(0.0254, warnings=BADQACC)), "rounded to 2 decimals"),
        (bracket_around(0.03), trace_of(run(0.0252), run(0.0254, warnings=BADQACC)), "rounded to 2 decimals"),
        (Bracket(0.03, 0.04), trace_of(run(0.03), run(0.04, warnings=BADQACC)), "too coarse"),
        (
            HIGH,
            trace_of(*(run(h, warnings=BADQACC) for h in (0.0255, 0.0377, 0.0438, 0.0469))),
            "goes on upwards",
        ),
        (LOW, trace_of(run(0.001, start=float("nan")), run(0.005)), "nan in data.qpos"),
        (LOW, trace_of(run(0.05, warnings=BADQACC, last=0.005)), "never reset it"),
        (
            LOW,
            trace_of(run(0.005), run(0.0054, warnings=BADQACC), differing_fields=(["body_mass"],)),
            "the mass differs",
        ),
    ],
)
def test_what_the_runs_show_is_said(claim: Claim, trace: Trace, said: str) -> None:
    sentence = told(claim, trace)
    assert said in sentence
    assert bool(said) == bool(sentence)


def test_an_integrator_that_was_not_asked_for_is_named() -> None:
    trace = trace_of(run(0.005, integrator=0), run(0.0054, warnings=BADQACC, integrator=0))
    assert "used Euler" in told(LOW, trace, code=IMPLICITFAST.code)
    assert "used Euler" not in told(LOW, trace)


def test_a_swallowed_slip_is_told_with_its_lines() -> None:
    notes = trace_of(run(0.001), run(0.05)).notes
    info = {"type": "AttributeError", "line": 14, "clause": 16, "times": 9, "message": "no such thing"}
    trace = Trace((*notes, Note("handled", info, np.empty(0))))
    assert trace.handled_exceptions == [HandledException("AttributeError", 14, 16, 9, "no such thing")]
    assert (explain_hidden_slip([trace, trace]) or "").startswith(
        "Line 14 raised an AttributeError (no such thing), and the `except` in line 16"
    )


@pytest.mark.parametrize(
    ("claim", "trace"),
    [
        (HIGH, trace_of(run(0.001), run(0.03, warnings=BADQACC), run(0.0304, warnings=BADQACC))),
        (LOW, trace_of(run(0.005), run(0.0054), run(0.05, warnings=BADQACC))),
        (LOW, trace_of(run(0.0048), run(0.0055, warnings=BADQACC))),
    ],
)
def test_no_number_of_a_hidden_case_is_told(claim: Claim, trace: Trace) -> None:
    sentence = told(claim, trace, hidden=True)
    assert sentence
    assert not any(number in sentence for number in ("30", "5.4", "0.4", "4.8", "5.5"))


TOP = trace_of(run(0.05, warnings=BADQACC))
CALM = trace_of(run(0.05), run(0.0255), run(0.0132))


@pytest.mark.parametrize(
    ("others", "said"),
    [
        ([(Bracket(0.001, 0.0132), CALM)], True),
        ([], False),
        ([(Bracket(0.001, 0.0132), trace_of(run(0.05), run(0.0255), run(0.0132, warnings=BADQACC)))], False),
        ([(NoLimit(), CALM)], False),
    ],
)
def test_a_test_that_is_turned_round_shows_in_both_its_answers(others: list[tuple[Claim, Trace]], said: bool) -> None:
    """A warning that is overlooked everywhere, or a criterion of one's own, is another mistake."""
    wrong = [judged(claim, trace) for claim, trace in ((NoLimit(), TOP), *others)]
    sentence = next((one for rules in ALL_RULES if (one := explain_searches(PARAMETERS, wrong, rules, wrong))), "")
    assert ("wrong way round" in sentence) == said


def test_every_wrong_claim_must_be_explained() -> None:
    one = judged(NoLimit(), trace_of(run(0.001), run(0.03)))
    other = judged(NoLimit(), trace_of(run(0.001), run(0.05, warnings=BADQACC)))
    assert explain_searches(PARAMETERS, [one, other], CERTAIN_RULES) is None
    assert explain_searches(PARAMETERS, [one, judged(NoLimit(), Trace())], CERTAIN_RULES) is None


@given(
    st.lists(st.floats(), max_size=4 * COLUMNS),
    st.dictionaries(
        st.sampled_from(["total", "models", "given", "set_s", "others"]),
        st.none() | st.integers() | st.text(max_size=4),
    ),
    st.sampled_from([LOW, HIGH, NoLimit(), Bracket(1.0, -1.0)]),
)
def test_whatever_the_trace_claims_nothing_is_raised(
    numbers: list[float], info: dict[str, object], claim: Claim
) -> None:
    trace = Trace((Note("search", info, np.array(numbers)),))
    read_search(trace)
    told(claim, trace)


@given(st.lists(st.floats(0, 1e4), min_size=COLUMNS, max_size=COLUMNS))
def test_a_run_of_any_numbers_is_read(row: list[float]) -> None:
    told(NoLimit(), trace_of(row, row))


@pytest.mark.cost
def test_watching_costs_a_hundredth_of_the_bisections() -> None:
    """One visible and six hidden trials of ten runs, beside the runs themselves, as minima over repetitions."""
    model = mujoco.MjModel.from_xml_string(MODEL)

    def bisect() -> None:
        for index in range(10):
            model.opt.timestep = 0.02 + 1e-4 * index
            data = mujoco.MjData(model)
            data.qpos[0] = 1.0
            while data.time < 3.0 and not data.warning.number.any():
                mujoco.mj_step(model, data)

    data = mujoco.MjData(model)

    def watch(hidden: bool) -> None:
        search = driver.Search()
        search.restart(hidden=hidden)
        search.given = driver.read_values(model)
        for _ in range(10):
            search.begin(model, data)
            search.finish()
        search.note(model)

    def cpu_of(work: Callable[[], None]) -> float:
        began = time.process_time()
        work()
        return time.process_time() - began

    works: tuple[Callable[[], None], ...] = (partial(watch, False), partial(watch, True), bisect)
    visible, hidden, whole = (min(each) for each in zip(*[map(cpu_of, works) for _ in range(30)], strict=True))
    assert visible + 6 * hidden < 0.01 * 7 * whole


LIMIT_S = 0.0201
"""Within 3 s from 1 rad a run of the lesson's servo is stable at 20 ms, and warns at 20.2 ms, under Euler."""

Update = Callable[[float, float, float], tuple[float, float]]


def bisect(update: Update, halvings: int = 8) -> tuple[list[list[float]], Bracket]:
    """The runs of a bisection between 1 and 50 ms that looks at the upper end first, and its last ends."""
    low, high, runs = 0.001, 0.05, [run(0.05, warnings=BADQACC)]
    for _ in range(halvings):
        middle = (low + high) / 2
        runs.append(run(middle, warnings=BADQACC * (middle > LIMIT_S)))
        low, high = update(low, middle, high)
    return runs, Bracket(low, high)


def halve(low: float, middle: float, high: float) -> tuple[float, float]:
    return (low, middle) if middle > LIMIT_S else (middle, high)


@pytest.mark.parametrize(
    ("factor", "returned"),
    [(0.9, ", 0.9 times what it found"), (0.95, ", 0.95 times what it found"), (0.931234567, " ms. Return the two")],
)
def test_a_right_search_is_called_right_whatever_is_returned(factor: float, returned: str) -> None:
    runs, ends = bisect(halve)
    sentence = told(ends.scale(factor), trace_of(*runs))
    assert f"Your search is right: {1e3 * ends.low:.4g} ms stayed stable, and at {1e3 * ends.high:.4g} ms" in sentence
    assert returned in sentence
    assert "your function returns None" in told(NoLimit(), trace_of(*runs))


def test_a_search_that_found_something_wrong_is_not_called_right() -> None:
    runs = [run(one[1] / 2, warnings=int(one[9])) for one in bisect(halve)[0]]
    assert "is right" not in told(HIGH, trace_of(*runs))


@pytest.mark.parametrize(
    ("update", "said"),
    [
        (lambda low, middle, high: (middle, middle) if middle > LIMIT_S else (middle, high), "lower end to the middle"),
        (lambda low, middle, high: (low, middle) if middle > LIMIT_S else (middle, middle), "upper end to the middle"),
        (lambda low, middle, high: (low, middle) if middle > LIMIT_S else (low, high), "never moves its lower end"),
        (lambda low, middle, high: (low, high) if middle > LIMIT_S else (middle, high), "never moves its upper end"),
        (lambda low, middle, high: (middle, high) if middle > LIMIT_S else (low, middle), "goes on upwards"),
    ],
)
def test_a_mutant_of_the_bisection_is_named(update: Update, said: str) -> None:
    runs, ends = bisect(update)
    assert said in told(ends, trace_of(*runs))


@given(st.lists(st.booleans(), min_size=3, max_size=9))
def test_a_right_bisection_is_no_mutant_whatever_it_takes_for_unstable(outcomes: list[bool]) -> None:
    low, high, runs = 0.001, 0.05, []
    for is_unstable in outcomes:
        middle = (low + high) / 2
        runs.append(run(middle, warnings=BADQACC * is_unstable))
        low, high = (low, middle) if is_unstable else (middle, high)
    wrong = [judged(HIGH, trace_of(*runs))]
    assert explain_searches(PARAMETERS, wrong, (explain_wrong_bisection,)) is None


def test_a_difference_that_changes_no_run_is_not_the_mistake() -> None:
    harmless = trace_of(run(0.005), run(0.0048), differing_fields=(["enableflags"],))
    assert "you call it unstable" in told(Bracket(0.0044, 0.0048), harmless)


def test_none_without_a_step_beside_a_search_under_another_integrator() -> None:
    wrong = [judged(NoLimit(), trace_of(), code=IMPLICITFAST.code)]
    beside = [*wrong, judged(Bracket(0.02, 0.0202), trace_of(run(0.02), run(0.0202, warnings=BADQACC)))]
    sentence = explain_searches(PARAMETERS, wrong, NO_STEP_RULES, beside) or ""
    assert sentence.startswith("Under implicitfast your function returned None without a single step")
    assert explain_searches(PARAMETERS, wrong, NO_STEP_RULES, wrong) != sentence
