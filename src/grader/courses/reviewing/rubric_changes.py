"""Recomputes reviews in the background whenever the content was loaded, so that points follow a changed rubric."""

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

import structlog
from sqlalchemy.orm import Session

from grader.courses.people.identity import Identity
from grader.courses.reviewing.desk import Desk
from grader.courses.reviewing.reviews import follow_rubric
from grader.courses.rules.rubric import compute_fingerprint, get_rubric
from grader.errors import NotFound
from grader.questions import Question
from grader.store.engine.database import Database
from grader.store.reviewing import reviews

AGAIN_S = 10.0
"""Pause after a failure, such as a lost database [s]."""

log = structlog.get_logger()


def list_outdated(desk: Desk, quiz: str, question: str, course: str) -> list[str]:
    """Returns the ids of submissions whose marks were computed with another rubric, in a course. Once a question has no
    rubric, its reviews stay as they are. Raises NotFound."""
    asked = desk.library.question(quiz, question)
    if not get_rubric(asked):
        return []
    with desk.database.read() as session:
        return reviews.list_of_other_rubric(session, quiz, question, compute_fingerprint(asked), course)


def count_followers(session: Session, quiz: str, question: Question, course: str) -> int:
    """Returns how many learners of a course have marks that will be computed again once a question has this rubric."""
    if not get_rubric(question):
        return 0
    return reviews.count_of_other_rubric(session, quiz, question.id, compute_fingerprint(question), course)


def recompute(desk: Desk, submission_id: str, who: Identity | None = None) -> bool:
    """Computes the marks of one submission again, in a transaction of its own. Returns whether its verdict changed."""
    with desk.database.write() as session:
        return follow_rubric(desk, session, submission_id, who)


@dataclass
class Recomputing:
    """A thread that recomputes the reviews of every question after each `wake`, and once at the start."""

    database: Database
    desk_of: Callable[[str], Desk]
    """The desk of a course."""
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
        """Ends the thread after the submission that it is at."""
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
        with self.database.read() as session:
            questions = reviews.list_with_rubric(session)
        for course, quiz, question in questions:
            with suppress(NotFound):  # the content has lost it
                self._recompute_question(course, quiz, question)

    def _recompute_question(self, course: str, quiz: str, question: str) -> None:
        desk, changed = self.desk_of(course), 0
        for submission_id in list_outdated(desk, quiz, question, course):
            if self._stop.is_set():
                return
            changed += recompute(desk, submission_id)
        if changed:
            log.info("reviews recomputed", course=course, quiz=quiz, question=question, changed=changed)
