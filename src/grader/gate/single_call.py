"""Calls that may hang, as those of a database that keeps its connections and answers nothing: each in a thread of its
own, one at a time, so that whoever asks can stop waiting and no threads pile up."""

import contextvars
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Generic, TypeVar

Value = TypeVar("Value")

DEADLINE_S = 4.0
"""How long a probe waits for what it asks [s]: those who watch a service commonly give up after five or ten."""

NAME = "single call"
"""The name of its threads."""


class SingleCall(Generic[Value]):
    """A function that runs once at a time: whoever asks while it runs gets that run's result."""

    def __init__(self, call: Callable[[], Value]) -> None:
        self.call = call
        self._lock = threading.Lock()
        self._running: Future[Value] | None = None

    def begin(self) -> Future[Value]:
        """Calls the function, unless a call is in progress. Returns the result to come, which cannot be cancelled."""
        with self._lock:
            if self._running is None or self._running.done():
                self._running = Future()
                self._running.set_running_or_notify_cancel()
                target = contextvars.copy_context().run
                # A daemon: a call that never ends must not hold up the end of the process.
                threading.Thread(target=target, args=(self._run, self._running), name=NAME, daemon=True).start()
            return self._running

    def _run(self, result: "Future[Value]") -> None:
        try:
            result.set_result(self.call())
        except BaseException as error:
            result.set_exception(error)
