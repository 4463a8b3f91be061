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
from support.sites import ROOT, open_site

SOURCES = str(Path(grader.__file__).parent)

MODULES_MAX, MOVES_MAX = 26, 100
"""Of an answer that is graded at once."""
QUEUED_MODULES_MAX, QUEUED_MOVES_MAX = 22, 120
"""Of a script until it is queued."""

WALKS = 3
"""The shortest of some walks counts: what is done once a minute, or for the first answer, is no part of it."""
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
        if not code.co_filename.startswith(SOURCES) or event not in ("call", "return"):
            return
        if code.co_code[at] == RESUME and code.co_code[at + 1] if event == "call" else code.co_code[at] == YIELD:
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


RESUME, YIELD = dis.opmap["RESUME"], dis.opmap["YIELD_VALUE"]
"""`RESUME 0` begins a function; one with another argument goes on after a `yield` or an `await`."""


def module_of_caller(frame: FrameType) -> str | None:
    """The next module of ours that is on the stack; None where a library called us."""
    caller = frame.f_back
    while caller is not None and not caller.f_code.co_filename.startswith(SOURCES):
        caller = caller.f_back
    return None if caller is None else caller.f_code.co_filename.removeprefix(SOURCES)


@pytest.fixture(scope="module")
def learner(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A learner of a server without a worker, whose threads all serve the one answer. `WALKING` follows them."""

    def follow(frame: FrameType, event: str, arg: Any) -> None:
        for walk in WALKING:
            walk.follow(frame, event, arg)

    threading.setprofile(follow)
    try:
        settings = Settings(content=ROOT, data=tmp_path_factory.mktemp("walks"), workers=0)
        with open_site(settings) as site:
            yield site.client("ann")
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


def shortest(walks: list[Walk]) -> Walk:
    """The walk with the fewest moves; prints it."""
    found = min(walks, key=lambda walk: len(walk.moves))
    print(f"{len(found.modules)} modules, {len(found.moves)} moves", *found.moves, sep="\n")
    return found


@pytest.mark.parametrize(("question", "answers"), [("q1", ["0", 1, 1]), ("q2", ["1.5 ms", "2.5 ms", "3.5 ms"])])
def test_an_instant_answer_meets_few_modules(learner: httpx.Client, question: str, answers: list[Any]) -> None:
    walk = shortest([walk_of(learner, "1.3-check", question, answer, 201) for answer in answers])
    assert len(walk.modules) <= MODULES_MAX
    assert len(walk.moves) <= MOVES_MAX


def test_a_script_meets_few_modules_until_it_is_queued(learner: httpx.Client) -> None:
    answers = [{"source": f"x = {number}"} for number in range(WALKS)]
    walk = shortest([walk_of(learner, "1.3-exercises", "servo-threshold", answer, 202) for answer in answers])
    assert len(walk.modules) <= QUEUED_MODULES_MAX
    assert len(walk.moves) <= QUEUED_MOVES_MAX
