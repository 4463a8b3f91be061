"""What judging costs us, and that a busy machine changes nothing in a verdict."""

import subprocess
import sys
import time
from collections.abc import Iterator

import mujoco
import pytest

from exercises.conftest import ROOT, Grade, model_xml, question
from grader.domain.quiz import CodeQuestion
from grader.domain.run import RunStatus
from grader.exercises import judge_exercise, plan_exercise
from grader.sandbox.jail import Jail

PROGRAMS = ROOT / "reference_solutions" / "1.3-exercises"
CASES = [
    ("servo-threshold", "correct__the_lessons_script_and_a_bisection", 50),
    ("servo-threshold", "partial__half_a_second", 50),
    ("rk4-step", "correct__classical", 150),
    ("rk4-step", "incorrect__state_aliases_data", 150),
    ("rk4-free-joint", "correct__one_mj_integratepos", 150),
    ("rk4-free-joint", "correct__quaternion_derivative", 150),
    ("rk4-free-joint", "incorrect__world_axes", 150),
]
"""Budgets in ms on a quiet machine where a call of mj_forward from Python takes FORWARD_MS on the double pendulum."""

MARGIN = 2.0
"""What a disturbed machine may cost above the budget; a quiet one takes half to two thirds of the budget."""

FORWARD_MS = 1.1e-3
CALLS = 10_000


def slowness() -> float:
    """How many times slower than that machine this one is right now."""
    model = mujoco.MjModel.from_xml_string(model_xml("double_pendulum"))
    data = mujoco.MjData(model)
    start = time.thread_time()
    for _ in range(CALLS):
        mujoco.mj_forward(model, data)
    return 1000 * (time.thread_time() - start) / (CALLS * FORWARD_MS)


def cost_ms(exercise: CodeQuestion, source: str, jail: Jail, seed: int) -> float:
    """CPU time of planning and judging, without the student's own; hidden cases never simulated before."""
    start = time.thread_time()
    plan = plan_exercise(exercise, model_xml, seed)
    planned = time.thread_time()
    report = jail.run(plan.job(source, exercise.limits))
    assert report.status is RunStatus.RETURNED
    judging = time.thread_time()
    judge_exercise(exercise, plan, report)
    return 1000 * (planned - start + time.thread_time() - judging)


@pytest.mark.cost
@pytest.mark.parametrize(("id_", "program", "budget_ms"), CASES)
def test_judging_stays_within_its_budget(id_: str, program: str, budget_ms: int, jail: Jail) -> None:
    """The best ratio of five draws, each beside its own yardstick: the machine's mood cancels.

    No two programs share a draw: what was simulated for one would cost the next nothing.
    """
    source = (PROGRAMS / id_ / f"{program}.py").read_text()
    first = 100 * (1 + CASES.index((id_, program, budget_ms)))
    costs = [cost_ms(question(id_), source, jail, seed) / slowness() for seed in range(first, first + 5)]
    assert min(costs) < MARGIN * budget_ms


@pytest.fixture
def busy_machine() -> Iterator[None]:
    """Every core busy, twice over."""
    spinning = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
    try:
        yield
    finally:
        for process in spinning:
            process.kill()
            process.wait()


@pytest.fixture
def verdicts_at_rest(grade: Grade) -> dict[str, str]:
    return verdicts(grade)


def verdicts(grade: Grade) -> dict[str, str]:
    chosen = [PROGRAMS / id_ / f"{program}.py" for id_, program, _ in CASES]
    return {path.stem: grade(question(path.parent.name), path.read_text()).model_dump_json() for path in chosen}


def test_a_busy_machine_changes_nothing(verdicts_at_rest: dict[str, str], busy_machine: None, grade: Grade) -> None:
    assert verdicts(grade) == verdicts_at_rest
