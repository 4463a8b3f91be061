"""A process of the jail that holds an author's program and answers calls, one at a time."""

import time
from collections.abc import Callable
from inspect import getsource
from queue import Empty, SimpleQueue
from threading import Thread

from grader.domain.run import Channel, Job, Limits, MalformedAnswer, RunReport
from grader.exercises.driving import program_caller
from grader.exercises.driving.embedding import compile_code
from grader.exercises.driving.program_caller import ANSWER_BYTES_MAX, MORE, PIECE_BYTES

DRIVER = 'exec(codes["caller"])\n'

CPU_S = 5.0
"""CPU time that a call may take [s]."""

LIMITS = Limits(cpu_s=120, wall_s=60, memory_mb=2048)
"""Of the process. Time in which it waits for calls does not count."""

SPENT_S_MAX, CALLS_MAX = 60.0, 1000
"""Time in calls [s], and calls, after which a process is replaced: well before it reaches its limits, and so that it
does not keep a worn-out zygote."""

IDLE_S = 60.0
"""Time without a call after which a process ends [s]."""

PIECES_MAX = ANSWER_BYTES_MAX // PIECE_BYTES + 1


class Caller:
    """A process with the program of this `text`, in a thread that serves it. One thread at a time may ask it."""

    def __init__(self, path: str, text: str, run: Callable[[Job], RunReport]) -> None:
        codes = {"caller": compile_code(getsource(program_caller))}
        job = Job(text, DRIVER, {"cpu_s": CPU_S}, LIMITS, filename=path, codes=codes, talk=self._talk)
        self._calls: SimpleQueue[bytes | None] = SimpleQueue()
        self._answers: SimpleQueue[bytes | RunReport | Exception] = SimpleQueue()
        self.calls, self._spent_s = 0, 0.0
        Thread(target=self._serve, args=(run, job), name="author's program", daemon=True).start()

    def ask(self, call: bytes) -> bytes | RunReport | Exception:
        """Makes a call; returns the answer. Or how the process ended, RETURNED if it was not needed for long; or what
        the jail raised. It cannot be asked again then."""
        began = time.monotonic()
        self._calls.put(call)
        answer = self._answers.get()
        self.calls += 1
        self._spent_s += time.monotonic() - began
        return answer

    @property
    def is_worn_out(self) -> bool:
        """Whether another process should take its place."""
        return self._spent_s > SPENT_S_MAX or self.calls >= CALLS_MAX

    def end(self) -> None:
        """Lets the process end."""
        self._calls.put(None)

    def _serve(self, run: Callable[[Job], RunReport], job: Job) -> None:
        try:
            self._answers.put(run(job))
        except Exception as error:  # for the thread that asks
            self._answers.put(error)

    def _talk(self, channel: Channel) -> None:
        """Passes calls on until the process ends, or is no longer needed. Raises ChannelClosed, MalformedAnswer."""
        while (call := self._wait_for_call()) is not None:
            channel.limit(CPU_S)
            pieces = [channel.ask(call)]
            while pieces[-1].startswith(MORE):
                if len(pieces) > PIECES_MAX:
                    raise MalformedAnswer
                pieces.append(channel.ask(MORE))
            self._answers.put(b"".join(piece[1:] for piece in pieces))
        channel.end()

    def _wait_for_call(self) -> bytes | None:
        try:
            return self._calls.get(timeout=IDLE_S)
        except Empty:
            return None
