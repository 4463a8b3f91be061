"""Recomputes reviews in the background whenever the content was loaded, so that points follow a changed rubric."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import structlog

from grader.courses.reviews import Desk, follow_rubric
from grader.courses.rubric import fingerprint
from grader.domain.quiz import Reviewable
from grader.errors import NotFound
from grader.identity import Identity
from grader.store import reviews

AGAIN_S = 10.0
"""Pause after a failure, such as a lost database [s]."""

log = structlog.get_logger()


def recompute(desk: Desk, quiz: str, question: str, who: Identity | None = None) -> int:
    """Computes the marks of a question again, each in a transaction of its own. Returns how many verdicts changed.

    `who` asked for it, for their course; None is for the service itself, in all courses. Once a question has no
    rubric, its reviews stay as they are. Idempotent. Raises NotFound.
    """
    asked = desk.library.question(quiz, question)
    if not isinstance(asked, Reviewable) or not asked.rubric:
        return 0
    with desk.database.read() as session:
        course = None if who is None else who.course
        waiting = reviews.of_other_rubric(session, quiz, question, fingerprint(asked), course)
    changed = 0
    for submission_id in waiting:
        with desk.database.write() as session:
            changed += follow_rubric(desk, session, submission_id, who)
    return changed


@dataclass
class Recomputing:
    """A thread that recomputes the reviews of every question after each `wake`, and once at the start."""

    desk: Callable[[], Desk]
    _news: threading.Event = field(default_factory=threading.Event)
    _stop: threading.Event = field(default_factory=threading.Event)
    _thread: threading.Thread | None = None

    def start(self) -> None:
        """Starts the thread."""
        self._news.set()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def wake(self) -> None:
        """Says that the content may have changed."""
        self._news.set()

    def stop(self) -> None:
        """Ends the thread after the question that it is at."""
        self._stop.set()
        self._news.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while self._news.wait() and not self._stop.is_set():
            self._news.clear()
            try:
                self._recompute_all()
            except Exception:
                log.exception("reviews could not be recomputed")
                self._stop.wait(AGAIN_S)
                self._news.set()

    def _recompute_all(self) -> None:
        desk = self.desk()
        with desk.database.read() as session:
            questions = reviews.with_rubric(session)
        for quiz, question in questions:
            if self._stop.is_set():
                return
            try:
                changed = recompute(desk, quiz, question)
            except NotFound:
                continue  # the content has lost it
            if changed:
                log.info("reviews recomputed", quiz=quiz, question=question, changed=changed)
