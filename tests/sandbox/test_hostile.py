"""Every program of tests/hostile in the real jail: its status, and what it leaves behind, which is nothing."""

import gc
import os
import platform
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.sandbox.jail import Jail
from sandbox.conftest import ROOT, Census, Content, at_rest_with, held_kb, settled

MACHINE = re.compile(r"^# machine: (.*)$", re.M)
DRIVER = """
import sys, types

sys.modules["target"] = target = types.ModuleType("target")
target.__dict__.update(TARGETS)

def run(student, inputs, submit):
    if hasattr(student, "main"):
        submit("value", student.main())
    submit("answer", [42.0])
"""


def programs() -> list[Path]:
    """Every program, but those whose system calls or instructions only another machine has."""
    here, paths = platform.machine(), sorted((ROOT / "tests" / "hostile").glob("*.py"))
    return [path for path in paths if here in (MACHINE.findall(path.read_text("utf-8")) or [here])]


PROGRAMS = programs()
CLEAN = Job("import mujoco\nprint('clean')\ndef main():\n    return [1.0, 2.0]\n", f"TARGETS = {{}}\n{DRIVER}", {})
GROWTH_KB_MAX = 60_000  # the largest flood is 16 MB of results, held twice while it is judged


def limits(source: str) -> Limits:
    """The defaults of the suite, or those in the program's second line."""
    match = re.search(r"^# limits: (.*)$", source, re.M)
    given = dict(pair.split("=") for pair in match.group(1).split()) if match else {}
    return Limits.model_validate({"cpu_s": 2.0, "wall_s": 10.0, "memory_mb": 256, "output_kb": 16} | given)


def words(report: RunReport) -> str:
    arrays = b"".join(array.tobytes() for array in report.results.values())
    return report.stdout + report.stderr + report.reason + repr(dict(report.results)) + arrays.decode("latin-1")


@pytest.fixture(scope="module")
def at_rest(jail: Jail) -> Census:
    """The census with the jail at rest, after a first clean job."""
    assert jail.run(CLEAN).status is RunStatus.RETURNED
    # bubblewrap, its pid 1 and the zygote; a keeper and a child for each of the two spares.
    return at_rest_with(processes=7)


@pytest.fixture(scope="module")
def resident_at_rest(at_rest: Census) -> Iterator[int]:
    """What this process holds then. Collections leave out what is there already: they would cost more than a job."""
    gc.collect()
    gc.freeze()
    yield held_kb()
    gc.unfreeze()


def test_there_are_at_least_a_hundred_programs() -> None:
    assert len(PROGRAMS) >= 100
    assert {path.stem.split("__")[0] for path in PROGRAMS} == {status.value for status in RunStatus}


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_hostile_program(path: Path, jail: Jail, content: Content, at_rest: Census, resident_at_rest: int) -> None:
    source = path.read_text(encoding="utf-8")
    targets = {"CONTENT": str(content.root), "SOURCE": str(ROOT / "src" / "grader"), "SERVER": os.getpid()}
    report = jail.run(Job(source, f"TARGETS = {targets!r}\n{DRIVER}", {}, limits(source)))
    assert report.status == path.stem.split("__")[0], (report.reason, report.stderr)
    assert report.reason or report.status is RunStatus.RETURNED
    assert content.canary not in words(report)
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", report.stdout + report.stderr)
    clean = jail.run(CLEAN)
    assert (clean.status, clean.stdout, list(clean.results["value"])) == (RunStatus.RETURNED, "clean\n", [1.0, 2.0])
    assert settled(at_rest) == at_rest
    assert held_kb() < resident_at_rest + GROWTH_KB_MAX
