"""The content as it stands now, replaced as a whole or not at all."""

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

    def __init__(self, root: Path) -> None:
        """Raises ContentError."""
        self._root = root
        self._reloading = Lock()
        self.pipeline = Pipeline(load(root))

    @property
    def library(self) -> Library:
        """The quizzes and models of now."""
        return self.pipeline.library

    def run_in(self, run: Callable[[Job], RunReport] | None) -> None:
        """From now on scripts run in this jail; None where it has closed."""
        self.pipeline = replace(self.pipeline, run=run)

    def reload(self) -> None:
        """Loads the folder again. Raises ContentError; then what was there stays."""
        with self._reloading:
            self.pipeline = replace(self.pipeline, library=load(self._root))
        log.info("content loaded", quizzes=len(self.library.quizzes))

    def reload_or_log(self) -> None:
        """As `reload`, for a signal: nobody is there to take the error."""
        try:
            self.reload()
        except ContentError as error:
            log.error("content refused; the old one stays", faults=[str(fault) for fault in error.faults])
