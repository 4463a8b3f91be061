"""The jail when it breaks itself: the zygote dies, is recycled, hangs about; nothing is left behind."""

import contextlib
import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.errors import JailFault
from grader.sandbox.jail import Jail
from sandbox.conftest import MODELS, at_rest_with, census, jailed, settled
from support.processes import descendants, find_parent, program_name

DRIVER = "def run(student, inputs, submit):\n    submit('answer', [1.0])\n"
TRIVIAL = Job("print('hi')", DRIVER, {})
SLEEPER = Job("import time\ntime.sleep(30)", DRIVER, {}, Limits(cpu_s=5, wall_s=60))


def zygotes() -> list[int]:
    """Interpreters whose parent is bubblewrap."""
    ours = descendants(os.getpid())
    return [pid for pid in ours if program_name(pid).startswith("python") and program_name(find_parent(pid)) == "bwrap"]


def patiently(jail: Jail, job: Job) -> RunReport:
    """As the pipeline does: one more try after a fault."""
    try:
        return jail.run(job)
    except JailFault:
        return jail.run(job)


def test_a_zygote_killed_in_the_middle_is_a_fault_and_a_new_one_takes_over() -> None:
    with Jail(MODELS, workers=2) as jail, ThreadPoolExecutor(1) as pool:
        running = pool.submit(jail.run, SLEEPER)
        time.sleep(0.5)
        (zygote,) = zygotes()
        os.kill(zygote, signal.SIGKILL)
        with pytest.raises(JailFault):
            running.result(timeout=20)
        assert patiently(jail, TRIVIAL).status is RunStatus.RETURNED
        assert zygotes() != [zygote]


def test_bubblewrap_killed_is_the_same() -> None:
    with Jail(MODELS, workers=1) as jail:
        for _ in range(3):
            (zygote,) = zygotes()
            os.kill(find_parent(zygote), signal.SIGKILL)
            assert patiently(jail, TRIVIAL).status is RunStatus.RETURNED


def test_spares_that_were_killed_are_not_handed_out() -> None:
    with Jail(MODELS, workers=2) as jail:
        at_rest_with(processes=7)
        (zygote,) = zygotes()
        for pid in descendants(zygote):
            with contextlib.suppress(ProcessLookupError):  # a child ends with its keeper
                os.kill(pid, signal.SIGKILL)
        reports = [patiently(jail, TRIVIAL) for _ in range(4)]
        assert {report.status for report in reports} == {RunStatus.RETURNED}


def test_the_next_child_is_made_once_a_script_has_ended() -> None:
    """What is prepared for the verdict meanwhile, from when the script is sent, would have to share a core with it."""
    seen: list[tuple[str, int]] = []

    def note(what: str) -> None:
        seen.append((what, len(jailed())))

    with Jail(MODELS, workers=1) as jail:
        at_rest = at_rest_with(processes=5)  # bubblewrap, its pid 1 and the zygote; a keeper and a child
        job = Job("import time\ntime.sleep(0.3)", DRIVER, {}, sent=lambda: note("sent"), heard=note)
        assert jail.run(job).status is RunStatus.RETURNED
        assert [what for what, _ in seen] == ["sent", "answer"]
        assert max(processes for _, processes in seen) == 5
        assert settled(at_rest) == at_rest


def test_zygotes_are_recycled_while_jobs_run() -> None:
    before = census()
    with Jail(MODELS, workers=2, recycle_after=20) as jail, ThreadPoolExecutor(2) as pool:
        first = set(zygotes())
        reports = list(pool.map(lambda _: jail.run(TRIVIAL), range(60)))
        assert {report.status for report in reports} == {RunStatus.RETURNED}
        deadline = time.monotonic() + 10
        while len(zygotes()) > 1 and time.monotonic() < deadline:
            time.sleep(0.05)
        assert len(zygotes()) == 1
        assert not first & set(zygotes())
    assert settled(before) == before


def test_closing_leaves_nothing_and_ends_running_jobs() -> None:
    before = census()
    jail = Jail(MODELS, workers=2)
    failures = list[str]()

    def run() -> None:
        try:
            jail.run(SLEEPER)
        except JailFault as fault:
            failures.append(str(fault))

    thread = threading.Thread(target=run)
    thread.start()
    time.sleep(0.5)
    jail.close()
    thread.join(20)
    assert len(failures) == 1
    with pytest.raises(JailFault, match="closed"):
        jail.run(TRIVIAL)
    assert settled(before) == before


def test_the_servers_environment_is_in_no_process_of_the_jail(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_TEST_SECRET", "canary-of-the-environment")
    with Jail(MODELS, workers=1):
        at_rest_with(processes=5)
        for pid in jailed():
            assert b"canary-of-the-environment" not in Path(f"/proc/{pid}/environ").read_bytes(), program_name(pid)


def test_runs_as_nobody_when_root_started_it() -> None:
    with Jail(MODELS, workers=1):
        at_rest_with(processes=5)
        (zygote,) = zygotes()
        expected = 65534 if os.geteuid() == 0 else os.geteuid()
        for pid in (zygote, *descendants(zygote)):
            status = Path(f"/proc/{pid}/status").read_text().splitlines()
            uids = next(line for line in status if line.startswith("Uid:")).split()[1:]
            assert set(uids) == {str(expected)}
