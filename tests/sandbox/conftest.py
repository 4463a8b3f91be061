"""A real jail over a content folder full of canaries, and a census of what it leaves behind."""

import ctypes
import gc
import os
import secrets
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from grader.sandbox.inside import kernel, lockdown
from grader.sandbox.jail import Jail
from support.processes import descendants, program_name

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"


@dataclass(frozen=True)
class Content:
    """A course's folder whose every secret place holds the canary."""

    root: Path
    canary: str = field(default_factory=lambda: f"canary{secrets.token_hex(16)}")

    @property
    def models(self) -> Path:
        return self.root / "models"

    def fill(self) -> None:
        shutil.copytree(MODELS, self.models)
        for name in ("quizzes/canary.json", "reference_solutions/canary.py", "data/grader.db", "data/secret.key"):
            (self.root / name).parent.mkdir(exist_ok=True)
            (self.root / name).write_text(self.canary)


@pytest.fixture(scope="session")
def content(tmp_path_factory: pytest.TempPathFactory) -> Content:
    content = Content(tmp_path_factory.mktemp("course"))
    content.fill()
    return content


@pytest.fixture(scope="module")
def jail(content: Content) -> Iterator[Jail]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GRADER_TEST_CANARY", content.canary)
        with Jail(content.models, workers=2) as jail:
            yield jail


def landlock_abi() -> int:
    """What this kernel's Landlock can do: 4 refuses TCP (Linux 6.7), 6 scopes signals and sockets (Linux 6.12)."""
    return kernel.syscall(kernel.LANDLOCK_CREATE_RULESET, None, ctypes.c_size_t(0), lockdown.LANDLOCK_VERSION_FLAG)


@dataclass(frozen=True, order=True)
class Census:
    """What this process holds: its descendants, its descriptors, the mounts it sees."""

    processes: int
    descriptors: int
    mounts: int


def census() -> Census:
    return Census(
        len(descendants(os.getpid())),
        len(list(Path("/proc/self/fd").iterdir())) - 1,
        len(Path("/proc/self/mountinfo").read_text().splitlines()),
    )


def settled(expected: Census, patience_s: float = 10.0) -> Census:
    """The census, once it is as expected: spares are made in the background."""
    deadline = time.monotonic() + patience_s
    while (now := census()) != expected and time.monotonic() < deadline:
        time.sleep(0.01)
    return now


def at_rest_with(processes: int, patience_s: float = 20.0) -> Census:
    """The census once the jails hold so many processes and the descriptors no longer change."""
    deadline, before = time.monotonic() + patience_s, census()
    while time.monotonic() < deadline:
        time.sleep(0.1)
        now = census()
        if now == before and len(jailed()) == processes:
            return now
        before = now
    raise AssertionError(f"no rest: {len(jailed())} processes in jails, {before}")


def jailed() -> set[int]:
    """The processes of our jails: bubblewrap and what it started.

    Other tests may have left a process with the interpreter, as multiprocessing does with its resource tracker.
    """
    cells = [pid for pid in descendants(os.getpid()) if program_name(pid) == "bwrap"]
    return {pid for cell in cells for pid in (cell, *descendants(cell))}


def resident_kb(pid: int) -> int:
    rows = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(row.split()[1]) for row in rows if row.startswith("VmRSS"))


def held_kb() -> int:
    """What this process holds in memory; what the C library keeps for later is given back to the system first."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return resident_kb(os.getpid())
