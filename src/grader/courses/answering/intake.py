"""Intake of new answers: they are decided on and stored, all that wait in one transaction."""

import secrets
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.answering.results import NewSubmission, store_new
from grader.courses.people.identity import FAILED, Identity
from grader.courses.rules.policy import Decision, decide, policy_in_force
from grader.domain.policy import Progress
from grader.domain.verdict import Status, Verdict
from grader.errors import CallerError, Conflict, TooManyRequests, Unauthorized, Unprocessable
from grader.grading.pipeline import ParsedSubmission
from grader.library import Library
from grader.queue import jobs
from grader.store import intake, submissions
from grader.store.engine.database import Database
from grader.store.engine.ids import RANDOM_DIGITS, make_id
from grader.store.intake import AnswerKeys, QuestionState, StoredOfAnswer
from grader.store.results import LearnerAt
from grader.store.submissions import SubmissionFilter
from grader.store.tables import IdempotencyKey, Submission

CREATED, ACCEPTED = 201, 202
RETRY_S = 30


@dataclass(frozen=True)
class Receipt:
    """A stored submission: 201 with its verdict, or 202 while it waits for one. `decision` says what may be seen."""

    submission: Submission
    verdict: Verdict | None
    http_status: int
    decision: Decision


@dataclass(frozen=True, eq=False)
class NewAnswer:
    """An answer that was read, and graded where that is instant; else it gets a job for a worker. The same idempotency
    `key` with the same answer gives the first receipt again. Of one learner `queue_max` scripts may wait."""

    who: Identity
    library: Library
    parsed: ParsedSubmission
    verdict: Verdict | None
    key: str | None = None
    queue_max: int = 0

    @cached_property
    def place(self) -> LearnerAt:
        """The learner at the question."""
        return LearnerAt(self.who.course, self.who.id, self.parsed.quiz.id, self.parsed.question.id)


def store_answers(database: Database, session: Session, answers: Sequence[NewAnswer]) -> list[Receipt | CallerError]:
    """Decides on answers in the order of their coming, and stores those that are taken. Returns the receipt of each,
    which holds once the transaction is committed, or else Unauthorized, Unprocessable, Conflict or TooManyRequests."""
    database.lock_learners(session, {(answer.who.course, answer.who.id) for answer in answers})
    batch = AnswerBatch(session, len(answers))
    keys = [AnswerKeys(answer.place, answer.who.credential, answer.key) for answer in answers]
    outcomes: list[Receipt | CallerError] = []
    for answer, stored in zip(answers, intake.read(session, keys, batch.clock), strict=True):
        try:
            outcomes.append(batch.accept(answer, stored))
        except CallerError as error:
            outcomes.append(error)
    database.tell_planner(session, batch.save())
    return outcomes


class AnswerBatch:
    """Answers of one transaction that were accepted, and what follows from them."""

    def __init__(self, session: Session, most: int) -> None:
        self.clock = datetime.now(UTC)
        # At once: after each call of the system a thread waits for its turn.
        digits = secrets.token_hex(RANDOM_DIGITS * (most + 1) // 2)
        self._random = [digits[at : at + RANDOM_DIGITS] for at in range(0, RANDOM_DIGITS * most, RANDOM_DIGITS)]
        self._session = session
        self._accepted: list[tuple[NewAnswer, Receipt]] = []
        self._states: dict[LearnerAt, QuestionState] = {}
        self._receipts: dict[tuple[str, str, str], tuple[NewAnswer, Receipt]] = {}
        self._queued: Counter[str] = Counter()

    def accept(self, answer: NewAnswer, stored: StoredOfAnswer) -> Receipt:
        """Decides on one answer. Raises Unauthorized, Unprocessable, Conflict, TooManyRequests."""
        if not stored.is_live:
            raise Unauthorized(FAILED)
        decision, state = self._decide(answer, stored.state), stored.state
        if answer.key is not None and (earlier := self._find_earlier(answer, stored, decision)) is not None:
            return earlier
        if decision.why_not is not None:
            raise Conflict(decision.why_not)
        if answer.verdict is None:
            self._refuse_flood(answer)
        submission = make_submission(answer, make_id(state.newest_id, self._random.pop()), 1 + state.progress.used)
        state.progress = add_attempt(state.progress, None if answer.verdict is None else answer.verdict.status)
        state.newest_id = submission.id
        self._states[answer.place] = state
        http_status = ACCEPTED if answer.verdict is None else CREATED
        receipt = Receipt(submission, answer.verdict, http_status, self._decide(answer, state))
        self._accepted.append((answer, receipt))
        if answer.key is not None:
            self._receipts[answer.who.course, answer.who.id, answer.key] = answer, receipt
        return receipt

    def save(self) -> int:
        """Stores the accepted answers, with everything that follows from them. Returns how many."""
        session, accepted = self._session, self._accepted
        if not accepted:
            return 0
        new = [
            NewSubmission(answer.library, receipt.submission, receipt.verdict, answer.place)
            for answer, receipt in accepted
        ]
        keys = [make_key_row(*receipt) for receipt in self._receipts.values()]
        store_new(session, new, self._states, self.clock, (IdempotencyKey, keys))
        for answer, receipt in accepted:
            if receipt.verdict is None:
                jobs.put(session, jobs.GRADE, receipt.submission.id, share=answer.who.id)
        return len(accepted)

    def _decide(self, answer: NewAnswer, state: QuestionState) -> Decision:
        """What the learner may do and see at the question now, after the answers that were accepted before."""
        parsed = answer.parsed
        policy = policy_in_force(parsed.quiz.default_policy, state.changes)
        return decide(policy, state.extension, parsed.question, state.progress, self.clock,
                      role=answer.who.role, published_at=state.published_at)  # fmt: skip

    def _find_earlier(self, answer: NewAnswer, stored: StoredOfAnswer, decision: Decision) -> Receipt | None:
        """The receipt of the first request with this key. Raises Unprocessable if that held another answer."""
        first = self._receipts.get((answer.who.course, answer.who.id, answer.key or ""))
        if first is not None:
            digest, earlier = first[0].parsed.digest, replace(first[1], decision=decision)
        elif (row := stored.earlier) is not None:
            submission = self._session.get_one(Submission, row.submission_id)
            body = submissions.read_verdicts(self._session, [submission]).get(submission.id)
            verdict = None if body is None else Verdict.model_validate(body)
            digest, earlier = row.request_digest, Receipt(submission, verdict, row.http_status, decision)
        else:
            return None
        if digest != answer.parsed.digest:
            raise Unprocessable("This Idempotency-Key was used for another request.")
        return earlier

    def _refuse_flood(self, answer: NewAnswer) -> None:
        """Counts one more script of a learner. Raises TooManyRequests if too many of them wait."""
        who, most = answer.who, answer.queue_max
        waiting = submissions.count_pending(self._session, SubmissionFilter(who.course, learner=who.id))
        if waiting + self._queued[who.id] >= most:
            raise TooManyRequests(f"{most} of your scripts are still waiting; wait for their verdicts.", RETRY_S)
        self._queued[who.id] += 1


def add_attempt(before: Progress, status: Status | None) -> Progress:
    """The progress after one more attempt with this status; None while it has no verdict."""
    uses_attempt, is_right = status is None or status.uses_attempt, status is Status.CORRECT
    return Progress(before.used + uses_attempt, before.pending + (status is None), before.solved or is_right)


def make_submission(answer: NewAnswer, submission_id: str, attempt: int) -> Submission:
    """The row of a new answer."""
    parsed = answer.parsed
    return submissions.make(
        **answer.place._asdict(), id=submission_id, user=answer.who.user, answer=parsed.text, seed=parsed.seed,
        content_digest=parsed.content_digest, attempt=attempt
    )  # fmt: skip


def make_key_row(answer: NewAnswer, receipt: Receipt) -> dict[str, Any]:
    """The row that makes a repeated request find its first receipt."""
    return {
        "course": answer.who.course, "learner": answer.who.id, "key": answer.key,
        "request_digest": answer.parsed.digest, "submission_id": receipt.submission.id,
        "http_status": receipt.http_status,
    }  # fmt: skip
