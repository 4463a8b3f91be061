"""Intake of new answers: they are decided on and stored, all that wait in one transaction."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.answering.access import LearnerAccess, may_be_extended
from grader.courses.answering.results import NewSubmission, count_new
from grader.courses.people.identity import FAILED, Identity
from grader.domain.verdict import Verdict
from grader.errors import CallerError, Conflict, TooManyRequests, Unauthorized, Unprocessable
from grader.grading.pipeline import ParsedSubmission
from grader.library import Library
from grader.queue import jobs
from grader.store import credentials, extensions, idempotency, question_states, submissions
from grader.store.engine.bulk_insert import insert_rows
from grader.store.engine.database import Database
from grader.store.results import LearnerAt
from grader.store.submissions import SubmissionFilter
from grader.store.tables import IdempotencyKey, Submission, new_id, now

CREATED, ACCEPTED = 201, 202
RETRY_S = 30


@dataclass(frozen=True)
class Receipt:
    """A stored submission: 201 with its verdict, or 202 while it waits for one. `access` says what may be seen."""

    submission: Submission
    verdict: Verdict | None
    http_status: int
    access: LearnerAccess


@dataclass(frozen=True, eq=False)
class NewAnswer:
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

    @cached_property
    def place(self) -> LearnerAt:
        """The learner at the question."""
        return LearnerAt(self.who.course, self.who.id, self.parsed.quiz_id, self.parsed.question.id)

    @cached_property
    def row_key(self) -> idempotency.Key | None:
        """The key of its row among the idempotency keys; None without one."""
        return None if self.key is None else (self.who.course, self.who.id, self.key)

    @property
    def extension_key(self) -> extensions.Key | None:
        """The key of the learner's extension of the quiz; None where none could change anything at the question."""
        course, learner, quiz, question = self.place
        return (course, quiz, learner) if may_be_extended(self.library, quiz, question) else None


def store_answers(database: Database, session: Session, answers: Sequence[NewAnswer]) -> list[Receipt | CallerError]:
    """Decides on answers in the order of their coming, and stores those that are taken.

    Returns the receipt of each, which holds once the transaction is committed, or else Unauthorized, Unprocessable,
    Conflict or TooManyRequests.
    """
    database.lock_learners(session, {(answer.who.course, answer.who.id) for answer in answers})
    batch = AnswerBatch(session, answers)
    outcomes: list[Receipt | CallerError] = []
    for answer in answers:
        try:
            outcomes.append(batch.accept(answer))
        except CallerError as error:
            outcomes.append(error)
    database.tell_planner(session, batch.save())
    return outcomes


class AnswerBatch:
    """Answers of one transaction: what is stored about them, and what those that were accepted add to it."""

    def __init__(self, session: Session, answers: Sequence[NewAnswer]) -> None:
        self._session, self._clock = session, now()
        self._live = credentials.find_live(session, {answer.who.credential for answer in answers}, self._clock)
        self._states = question_states.read_states(session, {answer.place for answer in answers})
        self._keys = idempotency.find(session, {answer.row_key for answer in answers if answer.row_key is not None})
        extensible = {answer.extension_key for answer in answers}
        self._extensions = extensions.of_learners(session, {key for key in extensible if key is not None})
        self._published: dict[tuple[str, str], Mapping[str, datetime]] = {}
        self._accepted: list[tuple[NewAnswer, Receipt]] = []
        self._receipts: dict[idempotency.Key, tuple[NewAnswer, Receipt]] = {}
        self._queued: Counter[str] = Counter()

    def accept(self, answer: NewAnswer) -> Receipt:
        """Decides on one answer. Raises Unauthorized, Unprocessable, Conflict, TooManyRequests."""
        if answer.who.credential not in self._live:
            raise Unauthorized(FAILED)
        access, place = self._access(answer), answer.place
        if answer.row_key is not None and (earlier := self._find_earlier(answer, answer.row_key, access)) is not None:
            return earlier
        decision = access.decide(place.quiz, place.question)
        if decision.why_not is not None:
            raise Conflict(decision.why_not)
        if answer.verdict is None:
            self._refuse_flood(answer)
        state, status = self._states[place], None if answer.verdict is None else answer.verdict.status
        submission = make_submission(answer, new_id(state.newest_id), 1 + state.progress.used)
        after = access.with_attempt((place.quiz, place.question), status)
        state.progress, state.newest_id = after.progress_at(place.quiz, place.question), submission.id
        receipt = Receipt(submission, answer.verdict, ACCEPTED if answer.verdict is None else CREATED, after)
        self._accepted.append((answer, receipt))
        if answer.row_key is not None:
            self._receipts[answer.row_key] = answer, receipt
        return receipt

    def save(self) -> int:
        """Stores the accepted answers, with everything that follows from them. Returns how many."""
        session, accepted = self._session, self._accepted
        submissions.add(session, [(receipt.submission, receipt.verdict) for _, receipt in accepted])
        insert_rows(session, IdempotencyKey, [make_key_row(*one) for one in self._receipts.values()])
        new = [NewSubmission(answer.library, receipt.submission, receipt.verdict) for answer, receipt in accepted]
        count_new(session, new, self._states)
        for answer, receipt in accepted:
            if receipt.verdict is None:
                jobs.put(session, jobs.GRADE, receipt.submission.id, share=answer.who.id)
        return len(accepted)

    def _access(self, answer: NewAnswer) -> LearnerAccess:
        """What the learner may do at the question now, after the answers that were accepted before."""
        course, _, quiz, question = answer.place
        if (course, quiz) not in self._published:
            is_withheld = answer.library.quiz(quiz).policy.feedback == "after_publish"
            self._published[course, quiz] = extensions.published(self._session, course, [quiz]) if is_withheld else {}
        state = self._states[answer.place]
        if answer.extension_key is not None:
            state.extension = self._extensions.get(answer.extension_key)
        return LearnerAccess(
            answer.library,
            answer.who.role,
            self._clock,
            {(quiz, question): state.progress},
            {} if state.extension is None else {quiz: state.extension},
            self._published[course, quiz],
        )

    def _find_earlier(self, answer: NewAnswer, key: idempotency.Key, access: LearnerAccess) -> Receipt | None:
        """The receipt of the first request with this key. Raises Unprocessable if that held another answer."""
        if key in self._receipts:
            first, receipt = self._receipts[key]
            digest, earlier = first.parsed.digest, replace(receipt, access=access)
        elif (row := self._keys.get(key)) is not None:
            submission = self._session.get_one(Submission, row.submission_id)
            body = submissions.verdicts(self._session, [submission]).get(submission.id)
            verdict = None if body is None else Verdict.model_validate(body)
            digest, earlier = row.request_digest, Receipt(submission, verdict, row.http_status, access)
        else:
            return None
        if digest != answer.parsed.digest:
            raise Unprocessable("This Idempotency-Key was used for another request.")
        return earlier

    def _refuse_flood(self, answer: NewAnswer) -> None:
        """Counts one more script of a learner. Raises TooManyRequests if too many of them wait."""
        who, most = answer.who, answer.queue_max
        waiting = submissions.pending(self._session, SubmissionFilter(who.course, learner=who.id))
        if waiting + self._queued[who.id] >= most:
            raise TooManyRequests(f"{most} of your scripts are still waiting; wait for their verdicts.", RETRY_S)
        self._queued[who.id] += 1


def make_submission(answer: NewAnswer, submission_id: str, attempt: int) -> Submission:
    """The row of a new answer."""
    parsed = answer.parsed
    return Submission(
        **answer.place._asdict(),
        id=submission_id,
        user=answer.who.user,
        answer=parsed.text,
        seed=parsed.seed,
        content_digest=answer.library.digest(parsed.quiz_id),
        attempt=attempt,
    )


def make_key_row(answer: NewAnswer, receipt: Receipt) -> dict[str, Any]:
    """The row that makes a repeated request find its first receipt."""
    return {
        "course": answer.who.course,
        "learner": answer.who.id,
        "key": answer.key,
        "request_digest": answer.parsed.digest,
        "submission_id": receipt.submission.id,
        "http_status": receipt.http_status,
    }
