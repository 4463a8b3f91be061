"""Handing in: new answers are decided on and stored, all that wait in one transaction."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.results import New, count_new
from grader.courses.standing import Standing, may_be_extended
from grader.domain.verdict import Verdict
from grader.errors import CallerError, Conflict, TooManyRequests, Unauthorized, Unprocessable
from grader.identity import FAILED, Identity
from grader.library import Library
from grader.pipeline import ParsedSubmission
from grader.queue import jobs
from grader.store import answers, extensions, submissions
from grader.store.database import Database
from grader.store.results import LearnerAt
from grader.store.rows import insert_rows, inserted_together
from grader.store.submissions import SubmissionFilter
from grader.store.tables import IdempotencyKey, Submission, new_id, now, plain

CREATED, ACCEPTED = 201, 202
RETRY_S = 30

Key = tuple[str, str, str]
"""Course, learner, and an idempotency key or a quiz."""


@dataclass(frozen=True)
class Receipt:
    """A stored submission: 201 with its verdict, or 202 while it waits for one. `standing` says what may be seen."""

    submission: Submission
    verdict: Verdict | None
    http_status: int
    standing: Standing


@dataclass(eq=False)
class Answer:
    """An answer that was read, and graded where that is instant; else it gets a job for a worker.

    The same idempotency `key` with the same answer gives the first receipt again. `queue_max` is how many scripts of
    one learner may wait.
    """

    who: Identity
    library: Library
    parsed: ParsedSubmission
    verdict: Verdict | None
    key: str | None = None
    queue_max: int = 0
    outcome: Receipt | CallerError | None = None
    """Set by `hand_in`."""

    def receipt(self) -> Receipt:
        """The outcome, once `hand_in` has set it. Raises it where the answer was refused."""
        if isinstance(self.outcome, CallerError):
            raise self.outcome
        assert self.outcome is not None
        return self.outcome

    @cached_property
    def at(self) -> LearnerAt:
        """The learner at the question."""
        return LearnerAt(self.who.course, self.who.id, self.parsed.quiz_id, self.parsed.question.id)

    @property
    def asked(self) -> answers.Asked:
        """What is asked about it before it is taken."""
        is_extensible = may_be_extended(self.library, *self.at[2:])
        return answers.Asked(*self.at, self.who.credential, self.key or "", is_extensible)

    @property
    def named(self) -> Key:
        """The idempotency key within the learner's course."""
        return self.who.course, self.who.id, self.key or ""


def hand_in(database: Database, session: Session, waiting: Sequence[Answer]) -> None:
    """Decides on answers in the order of their coming, and stores those that are taken.

    Their `outcome` holds once the transaction is committed: a receipt, or else Unauthorized, Unprocessable, Conflict
    or TooManyRequests.
    """
    database.lock_learners(session, {(one.who.course, one.who.id) for one in waiting})
    batch = Batch(session, waiting)
    for one in waiting:
        try:
            one.outcome = batch.take(one)
        except CallerError as refused:
            one.outcome = refused
    database.tell_planner(session, batch.store())


class Batch:
    """What is stored, and what the answers that were taken add to it."""

    def __init__(self, session: Session, waiting: Sequence[Answer]) -> None:
        self._session, self._clock = session, now()
        self._stored = answers.stored(session, [one.asked for one in waiting], self._clock)
        self._published: dict[tuple[str, str], Mapping[str, datetime]] = {}
        self._taken: dict[str, tuple[Answer, Receipt]] = {}
        self._receipts: dict[Key, tuple[Answer, Receipt]] = {}
        self._queued: Counter[str] = Counter()

    def take(self, answer: Answer) -> Receipt:
        """Decides on one answer. Raises Unauthorized, Unprocessable, Conflict, TooManyRequests."""
        if answer.who.credential not in self._stored.alive:
            raise Unauthorized(FAILED)
        standing = self._standing(answer)
        if answer.key is not None and (earlier := self._earlier(answer, standing)) is not None:
            return earlier
        quiz, question = answer.at[2:]
        decision = standing.decision(quiz, question)
        if decision.why_not is not None:
            raise Conflict(decision.why_not)
        if answer.verdict is None:
            self._refuse_flood(answer)
        here = self._stored.at[answer.at]
        submission = submission_of(answer, new_id(here.newest), 1 + here.progress.used)
        after = standing.with_attempt((quiz, question), None if answer.verdict is None else answer.verdict.status)
        here.progress, here.newest = after.progress_at(quiz, question), submission.id
        receipt = Receipt(submission, answer.verdict, ACCEPTED if answer.verdict is None else CREATED, after)
        self._taken[submission.id] = answer, receipt
        if answer.key is not None:
            self._receipts[answer.named] = answer, receipt
        return receipt

    def store(self) -> int:
        """Stores the answers that were taken, with everything that follows from them. Returns how many."""
        session, taken = self._session, list(self._taken.values())
        with inserted_together(session):
            submissions.add(session, [(receipt.submission, receipt.verdict) for _, receipt in taken])
            insert_rows(session, IdempotencyKey, [key_row(*one) for one in self._receipts.values()])
            new = [New(one.library, receipt.submission, receipt.verdict) for one, receipt in taken]
            count_new(session, new, self._stored.at)
        for answer, receipt in taken:
            if receipt.verdict is None:
                jobs.put(session, jobs.GRADE, receipt.submission.id, share=answer.who.id)
        return len(taken)

    def _standing(self, answer: Answer) -> Standing:
        course, _, quiz, question = answer.at
        if (course, quiz) not in self._published:
            withheld = answer.library.quiz(quiz).policy.feedback == "after_publish"
            self._published[course, quiz] = extensions.published(self._session, course, [quiz]) if withheld else {}
        stored = self._stored.at[answer.at]
        return Standing(
            answer.library,
            answer.who.role,
            self._clock,
            {(quiz, question): stored.progress},
            {} if stored.extension is None else {quiz: stored.extension},
            self._published[course, quiz],
        )

    def _earlier(self, answer: Answer, standing: Standing) -> Receipt | None:
        """The receipt of the first request with this key. Raises Unprocessable if that held another answer."""
        if (here := self._receipts.get(answer.named)) is not None:
            first, receipt = here
            digest, earlier = first.parsed.digest, replace(receipt, standing=standing)
        elif (row := self._stored.earlier.get(answer.named)) is not None:
            submission = self._session.get_one(Submission, row.submission_id)
            body = submissions.verdicts(self._session, [submission]).get(submission.id)
            verdict = None if body is None else Verdict.model_validate(body)
            digest, earlier = row.request_digest, Receipt(submission, verdict, row.http_status, standing)
        else:
            return None
        if digest != answer.parsed.digest:
            raise Unprocessable("This Idempotency-Key was used for another request.")
        return earlier

    def _refuse_flood(self, answer: Answer) -> None:
        """Counts one more script of a learner. Raises TooManyRequests if too many of them wait."""
        who, most = answer.who, answer.queue_max
        waiting = submissions.pending(self._session, SubmissionFilter(who.course, learner=who.id))
        if waiting + self._queued[who.id] >= most:
            raise TooManyRequests(f"{most} of your scripts are still waiting; wait for their verdicts.", RETRY_S)
        self._queued[who.id] += 1


def submission_of(answer: Answer, submission_id: str, attempt: int) -> Submission:
    """The row of a new answer."""
    parsed = answer.parsed
    values = {
        **answer.at._asdict(),
        "id": submission_id,
        "user": answer.who.user,
        "answer": parsed.text,
        "seed": parsed.seed,
        "content_digest": answer.library.digest(parsed.quiz_id),
        "attempt": attempt,
    }
    return plain(Submission, values)


def key_row(answer: Answer, receipt: Receipt) -> dict[str, Any]:
    """The row that makes a repeated request find its first receipt."""
    course, learner, key = answer.named
    return {
        "course": course,
        "learner": learner,
        "key": key,
        "request_digest": answer.parsed.digest,
        "submission_id": receipt.submission.id,
        "http_status": receipt.http_status,
    }
