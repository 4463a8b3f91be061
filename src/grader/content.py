"""Holds the current content for server and workers: a reload replaces all of it or nothing."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Lock

import structlog

from grader.domain.run import Job, RunReport
from grader.errors import ContentError
from grader.library import Library, load
from grader.pipeline import Pipeline

log = structlog.get_logger()


class Content:
    """One content folder. Take `pipeline` once per request or job: it is a snapshot that does not change."""

    def __init__(self, root: Path, secret: bytes) -> None:
        """Loads the folder; `secret` keys the seeds of hidden cases. Raises ContentError."""
        self._root = root
        self._reloading = Lock()
        self._listeners: list[Callable[[], None]] = []
        self.pipeline = Pipeline(load(root), secret=secret)

    @property
    def library(self) -> Library:
        """The quizzes and models that are loaded now."""
        return self.pipeline.library

    def run_in(self, run: Callable[[Job], RunReport]) -> None:
        """Runs scripts with `run`, the jail's, from now on."""
        self.pipeline = replace(self.pipeline, run=run)

    def after_reload(self, listener: Callable[[], None]) -> None:
        """Calls `listener` whenever the folder was loaded again."""
        self._listeners.append(listener)

    def reload(self) -> None:
        """Loads the folder again. Raises ContentError, and then keeps what was loaded before."""
        with self._reloading:
            self.pipeline = replace(self.pipeline, library=load(self._root))
        for listener in self._listeners:
            listener()
        log.info("content loaded", quizzes=len(self.library.quizzes))

    def reload_or_log(self) -> None:
        """As `reload`, for a signal handler: faults are logged, not raised."""
        try:
            self.reload()
        except ContentError as error:
            log.error("content refused; the old one stays", faults=[str(fault) for fault in error.faults])
