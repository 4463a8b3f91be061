"""What judging costs us, and that a busy machine changes nothing in a verdict."""

import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import mujoco
import pytest

from exercises.conftest import ROOT, Grade, model_xml, question
from grader.domain.run import RunStatus
from grader.exercises import judge_exercise, plan_exercise
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail

PROGRAMS = ROOT / "reference_solutions" / "1.3-exercises"
CASES = [
    ("servo-threshold", "correct__the_lessons_script_and_a_bisection", 2.5),
    ("servo-threshold", "incorrect__half_a_second", 2.7),
    ("rk4-step", "correct__classical", 6.2),
    ("rk4-step", "incorrect__state_aliases_data", 7.4),
    ("rk4-free-joint", "correct__one_mj_integratepos", 7.1),
    ("rk4-free-joint", "correct__quaternion_derivative", 8.5),
    ("rk4-free-joint", "incorrect__world_axes", 9.0),
]
"""Budgets, in times of the yardstick: a third above what was measured, on a busy machine as on a quiet one."""

DRAWS = 8
STEPS = 500


def source_of(id_: str, program: str) -> str:
    return (PROGRAMS / id_ / f"{program}.py").read_text()


def yardstick() -> Callable[[], None]:
    """The lesson's own run by a right script: compile the double pendulum, and take 500 Runge-Kutta steps by hand.

    The same kind of work as judging: Python, NumPy, and MuJoCo in small calls.
    """
    script: dict[str, Callable[[mujoco.MjModel, mujoco.MjData], None]] = {}
    exec(source_of("rk4-step", "correct__classical"), script)
    xml = model_xml("double_pendulum")

    def run() -> None:
        model = mujoco.MjModel.from_xml_string(xml)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        for _ in range(STEPS):
            script["rk4_step"](model, data)

    return run


def cpu_s(work: Callable[[], object]) -> float:
    """CPU time of this thread."""
    start = time.thread_time()
    work()
    return time.thread_time() - start


def judging_s(exercise: ScriptQuestion, source: str, jail: Jail, seed: int) -> float:
    """CPU time of planning and judging, without the student's own; hidden cases never simulated before."""
    start = time.thread_time()
    plan = plan_exercise(exercise, model_xml, seed)
    planned = time.thread_time()
    report = jail.run(plan.build_job(source, exercise.limits))
    assert report.status is RunStatus.RETURNED
    judging = time.thread_time()
    judge_exercise(exercise, plan, report)
    return planned - start + time.thread_time() - judging


@pytest.fixture
def own_heap() -> Iterator[None]:
    """Keeps what the rest of the suite holds in memory out of the collections during a measurement."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.cost
@pytest.mark.parametrize(("id_", "program", "budget"), CASES)
def test_judging_stays_within_its_budget(id_: str, program: str, budget: float, jail: Jail, own_heap: None) -> None:
    """The least CPU time of judging over the least of the yardstick, taken in turns: load on the machine cancels.

    What disturbs a run only adds to its time, so that the least of several is the nearest to the true one. No two
    programs share a draw: what was simulated for one would cost the next nothing.
    """
    source, exercise, run = source_of(id_, program), question(id_), yardstick()
    first = 100 * (1 + CASES.index((id_, program, budget)))
    pairs = [(judging_s(exercise, source, jail, first + draw), cpu_s(run)) for draw in range(DRAWS)]
    judging, beside = map(min, zip(*pairs, strict=True))
    assert judging / beside < budget


@pytest.fixture
def busy_machine() -> Iterator[None]:
    """Every core busy, twice over."""
    count = 2 * (os.cpu_count() or 1)
    spinning = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
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
    """Of one program of each exercise."""
    chosen = [PROGRAMS / id_ / f"{program}.py" for id_, program in {id_: program for id_, program, _ in CASES}.items()]
    return {path.stem: grade(question(path.parent.name), path.read_text()).model_dump_json() for path in chosen}


def test_a_busy_machine_changes_nothing(verdicts_at_rest: dict[str, str], busy_machine: None, grade: Grade) -> None:
    assert verdicts(grade) == verdicts_at_rest
