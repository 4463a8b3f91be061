"""Programs of authors that make arguments: called in the jail, kept by all that they depend on, faults told plainly."""

import json
import select
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exercises.conftest import ROOT
from exercises.test_values_exercise import exercise, folder
from grader.domain.run import Job, RunReport
from grader.domain.verdict import Status
from grader.errors import ContentError, JailFault, JailRefused
from grader.exercises import plan_exercise
from grader.exercises.driving import calling
from grader.exercises.running import program_calls
from grader.exercises.running.program_calls import AnswerCache, ProgramCall, ProgramCalls, call_program
from grader.grading.films import record_films
from grader.grading.pipeline import Pipeline
from grader.grading.processes import GradingProcess, ScriptJob
from grader.library import Library, PassedChecks, authors_jail, load
from grader.sandbox.jail import Jail

HEAD = "def arguments(model, numbers, rng):\n"
SWING = f"""import numpy as np

{HEAD}    times = np.linspace(0, 1, 20)
    return [np.sin(16 * times) + rng.normal(0, 0.1, 20), int(rng.integers(1, 9)), rng.uniform(1, 2)]
"""
SOLVED = "def two(signal, n, x):\n    return signal.sum() * n, x\n"


@pytest.fixture(scope="module")
def jail() -> Iterator[Jail]:
    with Jail(ROOT / "models", 1) as jail:
        yield jail


@pytest.fixture
def jobs(jail: Jail, monkeypatch: pytest.MonkeyPatch) -> list[Job]:
    """The jobs of the programs of this test, in a jail of the module's; nothing is kept of other tests."""
    seen: list[Job] = []

    def run(job: Job) -> RunReport:
        seen.append(job)
        return jail.run_beside(job)

    calls_in(run, monkeypatch)
    return seen


def calls_in(run: Callable[[Job], RunReport], monkeypatch: pytest.MonkeyPatch) -> None:
    """Has programs called by `run`, also those of content that is loaded."""
    monkeypatch.setattr(program_calls, "CALLS", ProgramCalls())
    monkeypatch.setattr("grader.library.loading.run_in_authors_jail", run)
    program_calls.use_jail(run)


def write(path: Path, text: str = SWING, **case: Any) -> Path:
    cases = [
        {"id": "seen", "arguments": {"program": "programs/made.py"}},
        {"id": "unseen", "hidden": True, "calls": 3, "arguments": {"program": "programs/made.py"}, **case},
    ]
    folder(path, SOLVED, cases=cases)
    (path / "models").mkdir(exist_ok=True)
    (path / "programs/made.py").write_text(text)
    return path


def list_arguments(library: Library, seed: int) -> list[tuple[Any, ...]]:
    trials = plan_exercise(exercise(library), library.model_xml, seed, library.text).trials
    return [call.arguments for trial in trials for call in trial.problem.calls]


def call(text: str, **changes: Any) -> list[Any]:
    given = {"path": "programs/made.py", "function": "arguments", "xml": "", "numbers": {}, "seed": 1, **changes}
    return call_program(ProgramCall(text=text, **given))


def test_a_script_is_judged_by_what_a_program_made_in_the_jail(tmp_path: Path, jail: Jail, jobs: list[Job]) -> None:
    library = load(write(tmp_path))
    ran: list[Job] = []

    def run(job: Job) -> RunReport:
        ran.append(job)
        return jail.run(job)

    assert Pipeline(library, run).grade("q", "two", {"source": SOLVED}, 5).status is Status.CORRECT
    assert [job.source for job in jobs] == [SWING], "one process of the program answers all calls, at load and later"
    assert [job.source for job in ran] == [SOLVED]
    drawn = list_arguments(library, 5)
    assert len(drawn) == 4
    assert len({json.dumps(one) for one in drawn}) == 4
    assert json.dumps(drawn[-1][0]) in json.dumps(ran[0].hidden_inputs)
    assert json.dumps(drawn[-1][0]) not in json.dumps(ran[0].inputs)


@pytest.mark.usefixtures("jobs")
def test_each_call_runs_the_program_anew_and_leaves_nothing_in_our_process() -> None:
    text = f"""import random, sys
import numpy as np
count = 0
sys.modules["left_behind"] = sys

{HEAD}    global count
    count += 1
    return [count, random.random(), np.random.random(), rng.random()]
"""
    one, again, other = (
        call(text, seed=seed, xml="", numbers={"n": at}) for seed, at in ((1, 1.0), (1, 2.0), (2, 1.0))
    )
    assert one == again
    assert one[:3] == other[:3]
    assert one[3] != other[3]
    assert one[3] == np.random.default_rng(1).random()
    assert "left_behind" not in sys.modules


@pytest.mark.usefixtures("jobs")
def test_a_program_gets_a_model_of_its_own_and_the_drawn_numbers() -> None:
    text = f"""{HEAD}    model.opt.timestep *= 2
    return [model.opt.timestep, numbers["mass"], model.nq]
"""
    xml = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
    for seed in (1, 2):
        assert call(text, xml=xml, numbers={"mass": 3.5}, seed=seed) == [0.004, 3.5, 1]


@pytest.mark.usefixtures("jobs")
def test_no_call_is_made_twice_and_what_loading_needs_outlives_the_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def count_calls(what: Callable[[], object]) -> int:
        made.clear()
        what()
        return len(made)

    def note(one: ProgramCall) -> Any:
        made.append(one)
        return ProgramCalls._call(calls, one)

    made: list[ProgramCall] = []
    calls = program_calls.CALLS
    monkeypatch.setattr(calls, "_call", note)
    root, passed = write(tmp_path), PassedChecks(tmp_path / "passed")
    library = load(root, passed=passed)
    assert len(made) == 4, "those of both cases, with the numbers of visible cases on the learner's machine"
    assert count_calls(lambda: list_arguments(library, 0)) == 0
    assert count_calls(lambda: list_arguments(library, 7)) == 4
    assert count_calls(lambda: list_arguments(library, 7)) == 0
    before = list_arguments(library, 0)
    monkeypatch.setattr(calls, "_kept", AnswerCache())  # as after a restart
    assert count_calls(lambda: list_arguments(load(root, passed=passed), 0)) == 0
    assert list_arguments(library, 0) == before
    assert count_calls(lambda: list_arguments(library, 7)) == 4, "of a submission nothing is written"
    (root / "programs/made.py").write_text(SWING.replace("16", "17"))
    assert count_calls(lambda: load(root, passed=passed)) == 4


def test_for_films_that_a_kind_does_not_have_nothing_is_drawn(tmp_path: Path, jobs: list[Job]) -> None:
    """They would be drawn in the process of the pages."""
    library = load(write(tmp_path), passed=PassedChecks(tmp_path / "passed"))
    jobs.clear()
    program_calls.CALLS._callers.clear()
    assert record_films(library, ("q", "two"), 9, {"evidence": {"claims": []}}) == []
    assert jobs == []


LOOPS = f"{HEAD}    n = 0\n    while True: pass\n"

FAULTS = {
    "x = 1": "programs/made.py defines no function arguments(model, numbers, rng); it defines none",
    "def other():\n    pass": "it defines other",
    f"{HEAD}    return 1 / 0": "ZeroDivisionError: division by zero, in line 2 of programs/made.py",
    f"{HEAD}    return [1\n": "SyntaxError: '[' was never closed (line 2: return [1)",
    f"import pandas\n{HEAD}    return [1]": "No module named 'pandas', in line 1 of programs/made.py (pandas is not",
    f"{HEAD}    open('/etc/passwd')": "No such file or directory: '/etc/passwd', in line 2 of programs/made.py",
    f"{HEAD}    import socket\n    socket.socket()": "in line 3 of programs/made.py",
    f"{HEAD}    import grader": "No module named 'grader', in line 2 of programs/made.py",
    f"{HEAD}    import os\n    os._exit(0)": "It ended its own process",
    f"{HEAD}    import ctypes\n    ctypes.string_at(0)": "Its process was ended by SIGSEGV",
    f"{HEAD}    raise SystemExit": "It called exit()",
    f"{HEAD}    return [[1 / 3] * 120_000]": "arguments: ValueError: what it returns takes more than 2 MB as JSON",
    f"{HEAD}    return 5": "programs/made.py: arguments must return a list, not int",
    LOOPS: "It takes more than 0.5 s of CPU time. It was busy in line 3 of programs/made.py (while True: pass)",
}


PART = next(iter(program_calls.OF_PROGRAM))


@pytest.mark.usefixtures("jobs")
@pytest.mark.parametrize("text", FAULTS)
def test_a_program_that_fails_is_told_with_its_file_and_line(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calling, "CPU_S", 0.5)
    monkeypatch.setitem(program_calls.OF_PROGRAM, PART, "It takes more than 0.5 s of CPU time.")
    with pytest.raises(ContentError) as refused:
        load(write(tmp_path, text))
    assert {fault.key for fault in refused.value.faults} == {f"two.check.cases.{index}.arguments" for index in (0, 1)}
    assert FAULTS[text] in str(refused.value.faults[0])


@pytest.mark.usefixtures("jobs")
def test_the_numbers_with_which_a_program_fails_are_told_to_its_author() -> None:
    with pytest.raises(
        ValueError, match=r"KeyError: 'gone' \(with mass = 3, kp = 0\.5\), in line 2 of programs/made\.py"
    ):
        call(f"{HEAD}    return numbers['gone']", numbers={"mass": 3.0, "kp": 0.5})


@pytest.mark.usefixtures("jobs")
def test_what_a_program_prints_is_dropped(capfd: pytest.CaptureFixture[str]) -> None:
    assert call(f"{HEAD}    print('x' * 10**7)\n    return [1]") == [1]
    assert capfd.readouterr().out == ""


@pytest.mark.usefixtures("jobs")
def test_long_answers_come_in_pieces_and_types_are_told() -> None:
    made = call(f"{HEAD}    return [rng.random(10_000), 'text', 3, True, {{}}, [[1, 2], [3]], float('nan')]")
    assert made[0] == np.random.default_rng(1).random(10_000).tolist()
    assert made[1:6] == ["text", 3, {"type": "bool"}, {"type": "dict"}, {"type": "list"}]
    assert np.isnan(made[6])


def test_a_process_that_ends_while_it_waits_is_replaced(jobs: list[Job], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calling, "IDLE_S", 0.01)
    text = f"{HEAD}    return [numbers['n']]"
    for index in range(3):
        assert call(text, numbers={"n": index}) == [index]
        time.sleep(0.3)
    assert len(jobs) == 3


def test_a_process_is_replaced_before_it_is_worn_out(jobs: list[Job], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calling, "CALLS_MAX", 3)
    for index in range(7):
        assert call(f"{HEAD}    return [numbers['n']]", numbers={"n": index}) == [index]
    assert len(jobs) == 3


def test_few_programs_have_a_process_at_a_time(jobs: list[Job]) -> None:
    for index in (*range(program_calls.CALLERS_MAX + 1), 0):
        assert call(f"{HEAD}    return [{index}]", seed=len(jobs)) == [index]
    assert len(program_calls.CALLS._callers) == program_calls.CALLERS_MAX
    assert len(jobs) == program_calls.CALLERS_MAX + 2


def test_the_memory_of_what_is_kept_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program_calls, "KEPT_BYTES_MAX", 100)
    kept = AnswerCache()
    for index in range(50):
        kept.keep(f"call {index}", {"made": [index]})
        kept.recall("call 0")
    assert kept.recall("call 49") == {"made": [49]}
    assert kept.recall("call 0") == {"made": [0]}, "it was asked for last"
    assert kept.recall("call 1") is None


def test_a_fault_of_the_jail_is_no_fault_of_the_program(jail: Jail, monkeypatch: pytest.MonkeyPatch) -> None:
    faults: list[Exception] = [JailFault("it broke"), RuntimeError("so did this")]

    def run(job: Job) -> RunReport:
        if faults:
            raise faults.pop(0)
        return jail.run_beside(job)

    calls_in(run, monkeypatch)
    with pytest.raises(JailFault, match="it broke"):
        call(SWING)
    with pytest.raises(RuntimeError, match="so did this"):
        call(SWING)
    assert call(SWING)


def test_a_program_whose_process_died_while_it_waited_is_called_again(jail: Jail, jobs: list[Job]) -> None:
    text = f"{HEAD}    return [numbers['n']]"
    assert call(text, numbers={"n": 1}) == [1]
    assert jail._pool._zygote is not None
    for child in [one for one in jail._pool._zygote.children if one.pid > 0]:
        child.kill()
        select.select([child.pidfd], [], [])
    assert call(text, numbers={"n": 2}) == [2]
    assert len(jobs) == 2


def test_a_machine_without_a_jail_runs_programs_in_this_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jobs: list[Job]
) -> None:
    jailed = list_arguments(load(write(tmp_path)), 3)

    def run(job: Job) -> RunReport:
        raise JailRefused("there is none")

    calls_in(run, monkeypatch)
    assert list_arguments(load(tmp_path), 3) == jailed
    with pytest.raises(ValueError, match=r"ZeroDivisionError: division by zero, in line 2 of programs/made\.py"):
        call(f"{HEAD}    return 1 / 0")
    assert len(jobs) == 1


@pytest.mark.slow
def test_a_grading_process_calls_programs_in_its_own_jail(tmp_path: Path) -> None:
    library = load(write(tmp_path))
    process = GradingProcess(allow_t2=False)
    try:
        process.wait_until_ready()
        for seed in (1, 2):
            verdict = process.judge(library, ScriptJob("q", "two", {"source": SOLVED}, seed))
            assert verdict.status is Status.CORRECT
    finally:
        process.close()


def test_the_jail_of_a_process_that_loads_content_is_closed_and_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    calls_in(authors_jail.run_in_authors_jail, monkeypatch)
    text = f"{HEAD}    return [rng.integers(9)]\n"
    before = call(text)
    authors_jail.close_jail()
    authors_jail.close_jail()
    assert call(text, seed=2) != []
    assert call(text) == before
    authors_jail.close_jail()
