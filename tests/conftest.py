"""Marks every test by what it uses, so that `pytest -m fast` (make test-fast) needs no list of files.

A test uses what its own code, its fixtures and the helpers that those call name in their code: `Jail` is the jail, and
so on. What cannot be seen in names, such as a server with a worker, is marked where it is written.
"""

import gc
import inspect
import os
import shutil
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import CodeType, FunctionType, ModuleType
from typing import Any

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings

from grader.logs import log_to_stderr

MARKS = {
    "Jail": "jail",
    "open_pipeline": "jail",
    "chromium": "browser",
    "sync_playwright": "browser",
    "subprocess": "process",
    "process_of": "process",
    "fork_command": "process",
    "check_source": "process",
}
"""What a name in the code says about a test."""

# A busy machine must not fail a property test: no limits of wall-clock time, for one example or for drawing them.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")

HERE = str(Path(__file__).parent)
NOT_FAST = {"cost", "slow", "postgres", *MARKS.values()}

LONGEST = (
    *("exercises/test_controller_exercise.py", "exercises/test_corpus.py", "exercises/test_reference_solutions.py"),
    *("platforms/test_platforms.py", "platforms/test_scores.py", "web/test_student.py", "queue/test_kills.py"),
    *("web/test_access.py", "web/test_cohort.py", "pack/test_gradescope.py", "house/test_house.py"),
    *("docs/test_deploy.py", "studies/test_service.py", "web/test_parts.py", "web/test_instructor.py"),
    *("sandbox/test_hostile.py", "studies/test_deadline.py", "client/test_lesson.py"),
    *("sandbox/test_talking.py", "commands/test_commands.py", "sandbox/test_layers.py", "service/test_demo.py"),
)
"""What takes longest comes first, and files of fast tests last: the last file decides when all processes have ended."""


KEEP_GRADERS = {"api", "client", "courses", "docs", "platforms", "service", "store", "web"}
"""Folders whose servers take over idle grading processes. Others look at the processes themselves, or need none."""

# Where compiled modules may not be kept, as in images of Python, each program that a test starts compiles all of ours.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# As every command logs. By default structlog draws the variables of a traceback, which takes seconds for a library.
log_to_stderr()

# To look for cycles through all that is imported and collected, again and again, takes longer than any test.
gc.set_threshold(50_000, 20, 20)


MEMORY = Path("/dev/shm")
MEMORY_BYTES_MIN = 4 << 30
"""Where less is free, as in most containers, the disk is used. pytest keeps the folders of three runs."""


def pytest_configure(config: pytest.Config) -> None:
    """Lets all processes of this run share which checks of content have passed; none is left of another run.

    Folders of tests are in memory where there is room: every commit of SQLite waits for a disk, some milliseconds each.
    """
    if hasattr(config, "workerinput"):  # a process that inherits it
        return
    if os.access(MEMORY, os.W_OK) and shutil.disk_usage(MEMORY).free > MEMORY_BYTES_MIN:
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))
    folder = TemporaryDirectory(prefix="grader-passed-")
    config.add_cleanup(folder.cleanup)
    os.environ["GRADER_CACHE"] = folder.name
    os.environ["GRADER_CONTENT"] = write_first_lesson(Path(folder.name, "content"))


def write_first_lesson(folder: Path) -> str:
    """Makes a content folder of lesson 1.3 alone: pages and commands are tested with one lesson, whatever else the
    project brings along."""
    root = Path(HERE).parent
    shutil.copytree(root / "models", folder / "models")
    for place in ("quizzes", "reference_solutions"):
        others = shutil.ignore_patterns("2.1-*", "3.1-*", "4.1*", "5.1*")
        shutil.copytree(root / place, folder / place, ignore=others)
    return str(folder)


@pytest.fixture(scope="module", autouse=True)
def spare_graders(request: pytest.FixtureRequest) -> Iterator[None]:
    """Lets the servers of a file take over grading processes; ends those that are left, and the jail
    of authors' programs, where processes are counted."""
    module = sys.modules.get("support.spare_graders")
    if request.path.relative_to(HERE).parts[0] in KEEP_GRADERS:
        from support.spare_graders import keeping_spares

        with keeping_spares():
            yield
    else:
        if module is not None:
            module.end_spares()
        if (authors := sys.modules.get("grader.library.authors_jail")) is not None:
            authors.close_jail()
        yield


def pytest_sessionfinish() -> None:
    if (module := sys.modules.get("support.spare_graders")) is not None:
        module.end_spares()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Shows why a test was run again: the summary only names it."""
    for report in terminalreporter.stats.get("rerun", ()):
        terminalreporter.section(f"run again: {report.nodeid} ({report.when})")
        terminalreporter.write_line(report.longreprtext)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--record-examples", action="store_true", help="write src/grader/api/examples.json anew")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    fast: set[pytest.Item] = set()
    for item in items:
        if isinstance(item, pytest.Function):
            for mark in marks_of(item):
                item.add_marker(mark)
        if NOT_FAST.isdisjoint(mark.name for mark in item.iter_markers()):
            item.add_marker("fast")
            fast.add(item)
    quick = {path: fast.issuperset(of) for path, of in by_file(items).items()}
    turns = {Path(HERE, name): turn for turn, name in enumerate(LONGEST)}
    items.sort(key=lambda item: (quick[item.path], turns.get(item.path, len(turns))))


def pytest_collection_finish() -> None:
    """What is there by now stays to the end."""
    gc.collect()
    gc.freeze()


def by_file(items: list[pytest.Item]) -> dict[Path, list[pytest.Item]]:
    """The tests of each file."""
    by_path: dict[Path, list[pytest.Item]] = {}
    for item in items:
        by_path.setdefault(item.path, []).append(item)
    return by_path


def marks_of(item: pytest.Function) -> set[str]:
    """The marks of what a test uses."""
    fixtures = (one.func for several in item._fixtureinfo.name2fixturedefs.values() for one in several)
    named = all_uses((item.function, *fixtures))
    parameters = item.callspec.params.values() if hasattr(item, "callspec") else ()
    marks = {MARKS[name] for name in named & MARKS.keys()} | {
        "postgres" for parameter in parameters if parameter == "postgresql"
    }
    return marks | ({"slow"} if is_hypothesis_test(item.function) else set())


@cache
def all_uses(functions: tuple[Any, ...]) -> frozenset[str]:
    """As `uses`, of a test with its fixtures."""
    return frozenset().union(*map(uses, functions))


@cache
def uses(function: Any) -> frozenset[str]:
    """The global names and attributes in the code of a function and of the tests' own functions that it calls."""
    used, due, seen = set[str](), [function], set[CodeType]()
    while due:
        one = inspect.unwrap(due.pop())
        if isinstance(one, FunctionType) and one.__code__ not in seen and one.__code__.co_filename.startswith(HERE):
            seen.add(one.__code__)
            inner = [part for part in one.__code__.co_consts if isinstance(part, CodeType)]
            names = {name for code in (one.__code__, *inner) for name in code.co_names}
            modules = [value for name in names if isinstance(value := one.__globals__.get(name), ModuleType)]
            scopes = [one.__globals__, *(vars(m) for m in modules if str(getattr(m, "__file__", "")).startswith(HERE))]
            due += [scope[name] for scope in scopes for name in names if callable(scope.get(name))]
            used |= names
    return frozenset(used)
