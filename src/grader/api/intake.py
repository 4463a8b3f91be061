"""Handing in an answer: read, graded or queued, and stored, in one transaction."""

from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy.orm import Session

from grader.api.context import Context
from grader.courses import results
from grader.courses.standing import Standing, standing_of
from grader.errors import Conflict, TooManyRequests, Unprocessable
from grader.identity import Identity
from grader.queue import jobs
from grader.store import submissions
from grader.store.submissions import SubmissionFilter
from grader.store.tables import IdempotencyKey, Submission, new_id

CREATED, ACCEPTED = 201, 202
RETRY_S = 30


class AnswerBody(BaseModel):
    """An answer to one question: an option index, a number or text, or {"source": "..."}."""

    model_config = ConfigDict(extra="forbid")

    quiz: str = Field(max_length=64)
    question: str = Field(max_length=64)
    answer: Any


@dataclass(frozen=True)
class Receipt:
    """A stored submission: 201 with its verdict, or 202 while it waits for one. `standing` says what may be seen."""

    submission: Submission
    verdict: Any | None
    http_status: int
    standing: Standing


def accept(context: Context, who: Identity, body: AnswerBody, key: str | None) -> Receipt:
    """Stores an answer, with its verdict where that is instant, else with a job for a worker.

    The same idempotency `key` with the same answer gives the first receipt again.
    Raises NotFound, Conflict, TooLarge, Unprocessable, TooManyRequests.
    """
    pipeline = context.content.of(who.course).pipeline
    parsed = pipeline.read(body.quiz, body.question, body.answer)
    at = (parsed.quiz_id, parsed.question.id)
    verdict = pipeline.judge(parsed) if parsed.is_instant else None
    http_status = ACCEPTED if verdict is None else CREATED
    with context.database.write() as session:
        context.database.lock_learner(session, who.course, who.id)
        standing = standing_of(session, pipeline.library, who, at)
        if key is not None and (earlier := submissions.find_key(session, who.course, who.id, key)):
            return replay(session, earlier, parsed.digest, standing)
        decision = standing.decision(*at)
        if decision.why_not is not None:
            raise Conflict(decision.why_not)
        submission = Submission(
            id=new_id(),
            course=who.course,
            learner=who.id,
            user=who.user,
            quiz=parsed.quiz_id,
            question=parsed.question.id,
            answer=parsed.text,
            seed=parsed.seed,
            content_digest=pipeline.library.digest(parsed.quiz_id),
            attempt=1 + standing.progress_at(*at).used,
        )
        submissions.add(session, submission, verdict)
        if verdict is None:
            refuse_flood(session, who, context.queue_per_user)
            jobs.put(session, jobs.GRADE, submission.id, share=who.id)
        results.count_new(session, pipeline.library, submission, verdict)
        if key is not None:
            session.add(key_row(who, key, parsed.digest, submission, http_status))
    plain = None if verdict is None else verdict.model_dump(mode="json")
    after = standing.with_attempt(at, None if verdict is None else verdict.status)
    return Receipt(submission, plain, http_status, after)


def refuse_flood(session: Session, who: Identity, queue_max: int) -> None:
    """Raises TooManyRequests if more than `queue_max` scripts of one learner wait."""
    if submissions.pending(session, SubmissionFilter(who.course, learner=who.id)) > queue_max:
        raise TooManyRequests(f"{queue_max} of your scripts are still waiting; wait for their verdicts.", RETRY_S)


def replay(session: Session, earlier: IdempotencyKey, digest: str, standing: Standing) -> Receipt:
    """The receipt of the first request with this key. Raises Unprocessable if that held another answer."""
    if earlier.request_digest != digest:
        raise Unprocessable("This Idempotency-Key was used for another request.")
    submission = session.get_one(Submission, earlier.submission_id)
    verdict = submissions.verdicts(session, [submission]).get(submission.id)
    return Receipt(submission, verdict, earlier.http_status, standing)


def key_row(who: Identity, key: str, digest: str, submission: Submission, http_status: int) -> IdempotencyKey:
    """The row that makes a repeated request find its first receipt."""
    return IdempotencyKey(
        course=who.course,
        learner=who.id,
        key=key,
        request_digest=digest,
        submission_id=submission.id,
        http_status=http_status,
    )
