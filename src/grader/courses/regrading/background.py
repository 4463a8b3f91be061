"""Regrading as jobs of the queue: a lane of a regrade at a time, in short pieces, so that live grading goes first.
Every piece is stored in one transaction with the next job of its lane. A piece that was interrupted is done again; what
it had stored is not."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby
from typing import Any

import structlog
from sqlalchemy.orm import Session

from grader.courses.answering import results
from grader.domain.verdict import Status, Verdict
from grader.errors import CallerError, InvalidAnswer, JailFault
from grader.grading.content import Archive
from grader.library import Library
from grader.queue import jobs
from grader.queue.worker import JobOutcome, Schedule
from grader.store import regrades, submissions
from grader.store.engine.database import Database
from grader.store.regrades import DONE, FAILED, UNFINISHED, WAITING, Regrade, RegradeItem
from grader.store.results import LearnerAt
from grader.store.results import find as find_result
from grader.store.tables import Result, Submission

JudgeBy = Callable[[Submission, str], Verdict]
"""Judges a submission by the content of a digest."""

PIECE = 5
"""Submissions that are stored at a time; their transaction must not hold up learners."""

PIECE_S = 1.0
"""After this time a piece is stored as it is [s]."""

LOOK_S = 1.0
"""Pause until the next look at a submission that is not graded yet [s]."""

OUR_FAULT = "The grader itself failed; the log has the reason. Start the regrade again."

VOLATILE = frozenset({"timing_ms", "environment", "stdout", "stderr", "content_digest", "remark", "line", "span"})
"""Fields of a verdict that do not make it another one."""

log = structlog.get_logger()


class RegradeOutcome(StrEnum):
    """What became of a submission. All but `CHANGED` keep the verdict."""

    CHANGED = "changed"
    SAME = "same"
    REVIEWED = "reviewed"
    """A person has decided, and the decision stays."""
    UNFIT = "unfit"
    """The answer is none to the question as it is now."""
    FAULT = "fault"
    """The grader itself failed."""


@dataclass(frozen=True)
class Work:
    """A submission to regrade, with its newest verdict."""

    number: int
    place: int
    submission: Submission | None
    verdict: Mapping[str, Any] | None
    reviewed: bool


@dataclass(frozen=True)
class Piece:
    """The part of a lane that is done next."""

    subject: str
    lane: int
    regrade: Regrade
    works: tuple[Work, ...]


@dataclass(frozen=True)
class RegradedSubmission:
    """A submission that was graded again. Without an outcome it waits for its first verdict."""

    work: Work
    outcome: RegradeOutcome | None
    verdict: Verdict | None = None


@dataclass(frozen=True)
class Regrading:
    """Does the jobs of regrades. `judge` grades; `retries` says how often a submission is tried."""

    database: Database
    archive: Archive
    judge: JudgeBy
    retries: Schedule

    def start(self, session: Session, subject: str) -> Piece | None:
        """Reads the next piece of a lane, unless the regrade or the lane is over."""
        regrade_id, _, lane = subject.partition(":")
        regrades.begin(session, regrade_id)
        regrade = session.get_one(Regrade, regrade_id, populate_existing=True)
        items = regrades.list_waiting(session, regrade_id, int(lane), PIECE)
        if regrade.status not in UNFINISHED or not items:
            return None
        return Piece(subject, int(lane), regrade, tuple(read_works(session, items)))

    def run(self, started: Piece) -> JobOutcome:
        """Grades the submissions of a piece, as many as the time allows."""
        deadline, done = time.monotonic() + PIECE_S, []
        for work in started.works:
            done.append(self._regraded(work, started.regrade.content_digest))
            if time.monotonic() > deadline:
                break
        return JobOutcome(lambda session: self._store(session, started, done))

    def give_up(self, started: Piece) -> JobOutcome:
        """Ends the regrade as failed; what it has stored stays."""

        def store(session: Session) -> None:
            regrade = regrades.lock(session, started.regrade.id)
            if regrade.status in UNFINISHED:
                regrades.finish(session, regrade, FAILED, OUR_FAULT)

        return JobOutcome(store)

    def put_back(self, session: Session, subject: str) -> None:
        """Nothing: a lane has no state of its own."""

    def _regraded(self, work: Work, digest: str) -> RegradedSubmission:
        submission = work.submission
        if submission is None:
            return RegradedSubmission(work, RegradeOutcome.UNFIT)
        if submission.status not in submissions.AT_REST:
            return RegradedSubmission(work, None)
        if work.reviewed:
            return RegradedSubmission(work, RegradeOutcome.REVIEWED)
        return self._judged(work, submission, digest)

    def _judged(self, work: Work, submission: Submission, digest: str) -> RegradedSubmission:
        try:
            verdict = self.judge(submission, digest)
        except (CallerError, InvalidAnswer):
            return RegradedSubmission(work, RegradeOutcome.UNFIT)
        except JailFault:
            log.exception("regrading failed", submission=submission.id)
            return RegradedSubmission(work, RegradeOutcome.FAULT)
        if verdict.status is Status.GRADER_FAULT:
            return RegradedSubmission(work, RegradeOutcome.FAULT)
        return RegradedSubmission(
            work, RegradeOutcome.SAME if is_same(work.verdict, verdict) else RegradeOutcome.CHANGED, verdict
        )

    def _store(self, session: Session, piece: Piece, done: list[RegradedSubmission]) -> None:
        regrade = regrades.lock(session, piece.regrade.id)
        if regrade.status not in UNFINISHED:
            return
        # No reviewer and no other regrade decides in between: with the lock, submissions at rest stay as they are read.
        self.database.lock(session, f"reviews\n{regrade.course}")
        items = {
            item.number: item
            for item in regrades.get_numbered(session, regrade.id, [regraded.work.number for regraded in done])
        }
        by_id = {
            submission.id: submission
            for submission in submissions.get_several(session, [item.submission_id for item in items.values()])
        }
        storing = _Storing(self, session, regrade, self.archive.current_library(session, regrade.course, regrade.quiz))
        pause_s = 0.0
        for _, theirs in groupby(done, key=lambda regraded: regraded.work.place):
            for regraded in theirs:  # in their order, so that the first tells what counted before
                item = items[regraded.work.number]
                if waits_s := storing.settle(item, by_id.get(item.submission_id), regraded):
                    pause_s = max(pause_s, waits_s)
                    break
        session.flush()
        if regrades.list_waiting(session, regrade.id, piece.lane, 1):
            jobs.put(session, jobs.REGRADE, piece.subject, share=regrade.id, delay_s=pause_s)
        elif not regrades.list_waiting(session, regrade.id, None, 1):
            regrades.finish(session, regrade, DONE)
            log.info("regraded", regrade=regrade.id)


@dataclass(frozen=True)
class _Storing:
    """Stores what became of the submissions of a piece; `library` has the policy that counts."""

    task: Regrading
    session: Session
    regrade: Regrade
    library: Library

    def settle(self, item: RegradeItem, submission: Submission | None, done: RegradedSubmission) -> float:
        """Stores what became of one submission. Returns the pause before it is tried again [s]; 0 if it is not."""
        if item.outcome != WAITING:
            return 0.0
        if done.outcome is None:
            return LOOK_S
        if done.outcome is RegradeOutcome.FAULT:
            item.tries += 1
            if (pause_s := self.task.retries.pause_after(item.tries)) is not None:
                return pause_s
        seen = done.work.submission
        if seen is None or submission is None:
            item.outcome = RegradeOutcome.UNFIT.value
            return 0.0
        if submission.revision != seen.revision:
            return LOOK_S  # decided over meanwhile: it is graded once more
        item.outcome = done.outcome.value
        self._change(item, submission, done)
        return 0.0

    def _change(self, item: RegradeItem, submission: Submission, done: RegradedSubmission) -> None:
        assert done.work.verdict is not None
        item.old_status, item.old_points = done.work.verdict["status"], done.work.verdict["points"]
        if done.verdict is not None:
            item.new_status, item.new_points = done.verdict.status.value, done.verdict.points
        key = LearnerAt.from_submission(submission)
        self.task.database.lock_learner(self.session, key.course, key.learner)
        item.counted_before = get_points(find_result(self.session, key))
        if self.regrade.dry_run:
            self.session.flush()
            item.counted_after = results.predict_points(
                self.session, self.library, key, list_changed(self.session, item)
            )
            return
        if done.outcome is RegradeOutcome.CHANGED and done.verdict is not None:
            results.append_verdict(
                self.task.database, self.library, self.session, submission, done.verdict, cause="regrade"
            )
        else:
            results.recount(self.session, self.library, key)
        item.counted_after = get_points(find_result(self.session, key))


def get_points(result: Result | None) -> float | None:
    """Returns the points that count; None if nothing does."""
    return None if result is None else result.points


def read_works(session: Session, items: Sequence[RegradeItem]) -> Iterator[Work]:
    """Yields the submissions of items, with what is known of them."""
    ids = [item.submission_id for item in items]
    by_id = {submission.id: submission for submission in submissions.get_several(session, ids)}
    verdicts, reviewed = submissions.read_verdicts(session, by_id.values()), regrades.find_reviewed(session, ids)
    for item in items:
        id_ = item.submission_id
        yield Work(item.number, item.place, by_id.get(id_), verdicts.get(id_), id_ in reviewed)


def list_changed(session: Session, item: RegradeItem) -> dict[str, tuple[Status, float]]:
    """Returns the new verdicts of the learner at the question so far, by submission."""
    return {
        other.submission_id: (Status(other.new_status), other.new_points or 0.0)
        for other in regrades.at_place(session, item.regrade_id, item.place)
        if other.outcome == RegradeOutcome.CHANGED and other.new_status is not None
    }


def is_same(old: Mapping[str, Any] | None, new: Verdict) -> bool:
    """Says whether a stored verdict says what the new one says: status, points, findings, evidence and explanation. The
    ids of findings say nothing: those of hidden cases were others in older versions."""
    fields = new.model_dump(mode="json")
    return old is not None and all(
        drop_ids(old.get(name)) == drop_ids(value) for name, value in fields.items() if name not in VOLATILE
    )


def drop_ids(value: Any) -> Any:
    """Returns findings without their ids; anything else as it is."""
    if not isinstance(value, list):
        return value
    return [{name: part for name, part in each.items() if name != "id"} if isinstance(each, dict) else each
            for each in value]  # fmt: skip
