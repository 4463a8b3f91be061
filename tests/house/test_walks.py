"""The walk of an answer through `src/grader`, as a reader follows it: which modules it meets, how often it moves."""

import dis
import threading
import time
from collections.abc import Iterator
from inspect import CO_GENERATOR
from pathlib import Path
from types import FrameType
from typing import Any

import httpx
import pytest

import grader
from grader.settings import Settings
from support.sites import ROOT, Site, open_site

SOURCES = str(Path(grader.__file__).parent)

SERVER = "/service/serving.py"
"""Stands where uvicorn stands: what it sends is no part of the walk."""

LIMITS = {"choice": (20, 74), "number": (26, 92), "typed number": (28, 102), "script": (25, 86)}
"""How many modules and moves an answer has at most: a choice that others have given, a right number, a wrong one that
was typed with a unit, which is read and searched for slips, and a script until it is queued.
"""

ENDED_S = 10.0


class Walk:
    """The calls from one module of ours into another, and the returns, through whatever code of others lies between.

    A coroutine that waits and goes on has neither returned nor been called again.
    """

    def __init__(self) -> None:
        self.modules = set[str]()
        self.moves: list[str] = []
        self._open: list[int] = []

    def follow(self, frame: FrameType, event: str, _arg: Any) -> None:
        """Notes an event of a thread, as `sys.setprofile` tells it."""
        code, at = frame.f_code, frame.f_lasti
        if not is_walked(code.co_filename) or event not in ("call", "return"):
            return
        if is_waiting(code.co_code[at], code.co_code[at + 1]):
            return
        if not code.co_flags & CO_GENERATOR:  # which may be left at a `yield`
            self._open.append(1 if event == "call" else -1)
        module, caller = code.co_filename.removeprefix(SOURCES), module_of_caller(frame)
        self.modules.add(module)
        if caller != module:
            self.moves.append(f"{caller} -> {module} {code.co_name}" if event == "call" else f"{caller} <- {module}")

    @property
    def is_over(self) -> bool:
        """Whether everything that was called has returned."""
        return not sum(self._open)


def is_walked(file: str) -> bool:
    """Whether the code of a file belongs to the walk."""
    return file.startswith(SOURCES) and not file.endswith(SERVER)


def is_waiting(operation: int, argument: int) -> bool:
    """Whether code is left or entered at a `yield` or an `await`, where Python 3.11 stands at the one or the other of
    two instructions, and 3.13 always at the second. `RESUME 0` begins a function."""
    return operation == dis.opmap["YIELD_VALUE"] or (operation == dis.opmap["RESUME"] and argument != 0)


def module_of_caller(frame: FrameType) -> str | None:
    """The next module of ours that is on the stack; None where a library called us."""
    caller = frame.f_back
    while caller is not None and not is_walked(caller.f_code.co_filename):
        caller = caller.f_back
    return None if caller is None else caller.f_code.co_filename.removeprefix(SOURCES)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """A server without a worker, whose threads all serve the one answer. `WALKING` follows them."""

    def follow(frame: FrameType, event: str, arg: Any) -> None:
        for walk in WALKING:
            walk.follow(frame, event, arg)

    threading.setprofile(follow)
    try:
        settings = Settings(content=ROOT, data=tmp_path_factory.mktemp("walks"), workers=0)
        with open_site(settings) as site:
            yield site
    finally:
        threading.setprofile(None)


WALKING: list[Walk] = []


def walk_of(client: httpx.Client, quiz: str, question: str, answer: Any, status: int) -> Walk:
    """The walk of one answer."""
    walk = Walk()
    WALKING.append(walk)
    made = client.post("/api/v1/submissions", json={"quiz": quiz, "question": question, "answer": answer})
    until = time.monotonic() + ENDED_S
    while not walk.is_over and time.monotonic() < until:
        time.sleep(0.001)
    WALKING.remove(walk)
    assert made.status_code == status, made.text
    assert walk.is_over
    return walk


ANSWERS: dict[str, tuple[str, str, list[Any], int]] = {
    "choice": ("1.3-check", "q1", ["0", 1, 1], 201),
    "number": ("1.3-check", "q2", [5, 5.001, 5.002], 201),
    "typed number": ("1.3-check", "q2", ["1.5 ms", "2.5 ms", "3.5 ms"], 201),
    "script": ("1.3-exercises", "servo-threshold", [{"source": f"x = {number}"} for number in range(3)], 202),
}
"""Quiz, question, answers and status: the shortest of some walks counts, without what is done every few minutes, or for
the first answer alone.
"""


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_meets_few_modules(site: Site, name: str) -> None:
    quiz, question, answers, status = ANSWERS[name]
    learner = site.client(name.replace(" ", "-"))  # who has no result yet that a wrong answer would leave as it is
    walk = min((walk_of(learner, quiz, question, answer, status) for answer in answers), key=lambda one: len(one.moves))
    print(f"{name}: {len(walk.modules)} modules, {len(walk.moves)} moves", *walk.moves, sep="\n")
    assert len(walk.modules) <= LIMITS[name][0]
    assert len(walk.moves) <= LIMITS[name][1]
