"""Calls functions of authors' programs in the jail, and keeps what they return by all that it depends on: no call is
made twice. On a machine without a jail they run in this process."""

import hashlib
import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from traceback import walk_tb
from typing import Any, Protocol

import structlog

from grader.domain.run import Job, RunReport, RunStatus
from grader.errors import JailFault, JailRefused
from grader.exercises.crashes import explain_error
from grader.exercises.driving.calling import CPU_S, Caller
from grader.exercises.driving.program_caller import call_function
from grader.exercises.programs import limit_lines, run_program

CALLERS_MAX = 4
"""Programs that have a process at the same time."""

KEPT_BYTES_MAX = 32 << 20
"""Memory of what is kept [bytes]: some ten thousand calls of a few hundred numbers."""

OF_PROGRAM = {
    "The script used up the CPU time that one case may take.": f"It takes more than {CPU_S:g} s of CPU time.",
    "The script's": "Its",
    "The script": "It",
}
"""How the jail speaks of a script, and how it is said of a program."""

OF_STARTER = "keep the parameters of the starter"
OF_ARGUMENTS = "a program that makes arguments has the parameters (model, numbers, rng)"

log = structlog.get_logger()


@dataclass(frozen=True)
class ProgramCall:
    """A call of a function of an author's program, which makes of drawn numbers what a trial needs: reachable targets,
    a noisy signal. `function(model, numbers, rng)` of the program with this `text` gets the model of `xml`, or None,
    and a generator of NumPy with this `seed`."""

    path: str
    text: str
    function: str
    xml: str
    numbers: Mapping[str, float]
    seed: int

    @property
    def digest(self) -> str:
        """A digest of all that the result depends on, but for the versions of code: a shelf is of one version."""
        text = json.dumps([self.text, self.function, self.xml, dict(self.numbers), self.seed])
        return hashlib.sha256(text.encode()).hexdigest()

    def write(self) -> dict[str, Any]:
        """Returns the call as the caller in the jail reads it."""
        return {"function": self.function, "xml": self.xml, "numbers": dict(self.numbers), "seed": self.seed}


class Shelf(Protocol):
    """Keeps plain JSON by name, beyond the end of the process."""

    def recall(self, name: str) -> Any | None:
        """Returns what was kept; None if there is nothing that can be read."""

    def keep(self, name: str, result: Any) -> None:
        """Keeps a result, if that is possible."""


class AnswerCache:
    """Answers of calls, the newest KEPT_BYTES_MAX of them."""

    def __init__(self) -> None:
        self._texts: OrderedDict[str, bytes] = OrderedDict()
        self._bytes = 0

    def recall(self, digest: str) -> Any | None:
        """Returns the answer of a call; None if it is not kept."""
        if digest not in self._texts:
            return None
        self._texts.move_to_end(digest)
        return json.loads(self._texts[digest])

    def keep(self, digest: str, answer: Any) -> None:
        """Keeps an answer, in place of those that were not asked for longest."""
        self._texts[digest] = json.dumps(answer).encode()
        self._bytes += len(self._texts[digest])
        while self._bytes > KEPT_BYTES_MAX:
            self._bytes -= len(self._texts.popitem(last=False)[1])


class ProgramCalls:
    """Makes the calls of this process, one at a time. `run` is that of a jail for jobs that last: it raises JailFault,
    and JailRefused on a machine without a jail."""

    def __init__(self) -> None:
        self.run: Callable[[Job], RunReport] = refuse_job
        self.shelf: Shelf | None = None
        self._kept, self._callers, self._lock = AnswerCache(), OrderedDict[tuple[str, str], Caller](), Lock()
        self._refused: Callable[[Job], RunReport] | None = None

    def make(self, call: ProgramCall, *, is_fixed: bool) -> Any:
        """Returns the answer of a call, kept or new; one that `is_fixed` stays on the shelf. Raises ValueError for a
        program that fails, and JailFault."""
        shelf, digest = self.shelf if is_fixed else None, call.digest
        with self._lock:
            if (answer := self._kept.recall(digest)) is not None:
                return answer
            answer = shelf.recall(digest) if shelf is not None else None
            if answer is None:
                answer = self._call(call)
                if shelf is not None:
                    shelf.keep(digest, answer)
            self._kept.keep(digest, answer)
        return answer

    def _call(self, call: ProgramCall) -> Any:
        """Makes a call. A process that has ended while it waited is replaced."""
        if self.run == self._refused:
            return call_here(call)
        caller = self._find_caller(call)
        is_new = not caller.calls
        answer = caller.ask(json.dumps(call.write()).encode())
        if isinstance(answer, bytes):
            return read_json(answer, call)
        del self._callers[call.path, call.text]
        if isinstance(answer, JailRefused):
            log.warning("authors' programs run in this process", why=str(answer))
            self._refused = self.run
            return call_here(call)
        if not is_new and (isinstance(answer, JailFault) or is_returned(answer)):
            return self._call(call)
        raise answer if isinstance(answer, Exception) else ValueError(explain_end(answer.reason, call))

    def _find_caller(self, call: ProgramCall) -> Caller:
        """Returns the process of a program; a new one may take the place of the one that was not asked for longest."""
        at = call.path, call.text
        caller = self._callers.pop(at, None)
        if caller is not None and caller.is_worn_out:
            caller.end()
            caller = None
        self._callers[at] = caller or Caller(*at, self.run)
        if len(self._callers) > CALLERS_MAX:
            self._callers.popitem(last=False)[1].end()
        return self._callers[at]


def refuse_job(job: Job) -> RunReport:
    """Raises JailFault: this process has neither loaded content nor opened a jail."""
    raise JailFault("no jail is set up: authors' programs cannot be called")


CALLS = ProgramCalls()
"""Those of this process."""


def use_jail(run: Callable[[Job], RunReport], shelf: Shelf | None = None) -> None:
    """Has the authors' programs of this process called in a jail from now on, whose `run` is for jobs that last. What
    content that is loaded needs stays on the shelf."""
    CALLS.run, CALLS.shelf = run, shelf


def call_program(call: ProgramCall, *, is_fixed: bool = False) -> list[Any]:
    """Returns what a function of an author's program returns, as a list of plain JSON: texts, nested lists of numbers,
    and {"type": its name} for anything else. With `is_fixed` it is kept beyond the end of this process. Raises
    ValueError for a program that fails or gives no list, and JailFault."""
    answer = CALLS.make(call, is_fixed=is_fixed)
    if isinstance(values := answer.get("made"), list):
        return values
    if "type" in answer:
        raise ValueError(f"{call.path}: {call.function} must return a list, not {answer['type']}")
    defined = ", ".join(map(str, answer.get("defines", ()))) or "none"
    raise ValueError(f"{call.path} defines no function {call.function}(model, numbers, rng); it defines {defined}")


def read_json(text: bytes, call: ProgramCall) -> dict[str, Any]:
    """Returns an answer, which the author's process has written. Raises ValueError."""
    try:
        answer = json.loads(text)
    except (ValueError, RecursionError):
        answer = None
    if not isinstance(answer, dict):
        raise ValueError(f"{call.path}: {call.function} sends back no JSON object")
    return answer


def is_returned(ending: RunReport | Exception) -> bool:
    """Whether a process ended as it was told to."""
    return isinstance(ending, RunReport) and ending.status is RunStatus.RETURNED


def explain_end(reason: str, call: ProgramCall) -> str:
    """Returns why a program ended, from what the jail says of a script."""
    for of_script, of_program in OF_PROGRAM.items():
        reason = reason.replace(of_script, of_program)
    why = explain_error(reason.replace("your script", call.path)).replace(f"{OF_STARTER}, in their order", OF_STARTER)
    return f"{call.path}: {call.function}: {why.replace(OF_STARTER, OF_ARGUMENTS)}"


def call_here(call: ProgramCall) -> dict[str, Any]:
    """Makes a call in this process. Raises ValueError."""
    try:
        program = run_program(call.path, call.text)
        return limit_lines(lambda: call_function(program, call.write()))
    except Exception as error:  # an author's program may raise anything
        lines = [line for frame, line in walk_tb(error.__traceback__) if frame.f_code.co_filename == call.path]
        place = f", in line {lines[-1]} of {call.path}" if lines else ""
        raise ValueError(f"{call.path}: {call.function}: {type(error).__name__}: {error}{place}") from error
