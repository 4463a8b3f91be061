"""An answer comes in: read, graded or queued, and kept, in one transaction."""

import json
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy.orm import Session

from grader.api.context import Context
from grader.domain.quiz import CodeQuestion, Question
from grader.domain.verdict import Verdict
from grader.errors import Conflict, InvalidAnswer, TooLarge, TooManyRequests, Unprocessable
from grader.identity import Identity
from grader.pipeline import Pipeline, seed_of, submission_digest
from grader.queue import jobs
from grader.store import submissions
from grader.store.submissions import Chosen
from grader.store.tables import IdempotencyKey, Submission, new_id

GRADE = "grade"
"""The topic of jobs that grade a submission."""

TEXT_BYTES_MAX = 64 * 1024
"""Longest answer that is no script."""

LEVELS_MAX = 16
"""How deep lists and objects may stand in an answer; no kind of question wants more than one level."""

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
    """What became of an answer: 201 with a verdict, or 202 while it waits."""

    submission: Submission
    verdict: Any | None
    http_status: int


def take_in(context: Context, who: Identity, body: AnswerBody, key: str | None) -> Receipt:
    """Keeps the answer, with its verdict where that is instant. `key`: the same one again makes nothing new.

    Raises NotFound, Conflict, TooLarge, Unprocessable, TooManyRequests.
    """
    answer = canonical(body.answer)
    pipeline = context.content.pipeline
    question = pipeline.library.question(body.quiz, body.question)
    verdict = verdict_at_once(pipeline, body, question)
    digest = submission_digest(body.quiz, body.question, body.answer)
    with context.database.write() as session:
        context.database.lock(session, f"{who.course}\n{who.user}")
        if key is not None and (earlier := submissions.find_key(session, who.course, who.user, key)):
            return replay(session, earlier, digest)
        submission = Submission(
            id=new_id(),
            course=who.course,
            user=who.user,
            quiz=body.quiz,
            question=body.question,
            answer=answer,
            seed=seed_of(digest) if isinstance(question, CodeQuestion) else None,
            content_digest=pipeline.library.digest(body.quiz),
            attempt=next_attempt(session, who, body, question),
        )
        submissions.add(session, submission, verdict)
        if verdict is None:
            refuse_flood(session, who, context.queue_per_user)
            jobs.put(session, GRADE, submission.id)
        http_status = ACCEPTED if verdict is None else CREATED
        if key is not None:
            session.add(remember(who, key, digest, submission, http_status))
    if verdict is None:
        context.wake()
        return Receipt(submission, None, http_status)
    return Receipt(submission, verdict.model_dump(mode="json"), http_status)


def canonical(value: Any) -> str:
    """The value as JSON text in one form. Raises Unprocessable for what is no text in UTF-8, or nested too deep."""
    refuse_depth(value, LEVELS_MAX)
    try:
        json.dumps(value, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        raise Unprocessable("The answer is not valid UTF-8 text.") from error
    return json.dumps(value, sort_keys=True)


def refuse_depth(value: Any, levels: int) -> None:
    """Raises Unprocessable where lists and objects stand in each other more than `levels` deep."""
    if isinstance(value, dict | list):
        if not levels:
            raise Unprocessable("The answer is nested too deep.")
        for item in value.values() if isinstance(value, dict) else value:
            refuse_depth(item, levels - 1)


def verdict_at_once(pipeline: Pipeline, body: AnswerBody, question: Question) -> Verdict | None:
    """The verdict where there is no script to run: on every other kind, and on a script that cannot be read."""
    if not pipeline.is_instant(question):
        try:
            pipeline.read_answer(body.quiz, body.question, body.answer)
        except InvalidAnswer:
            return pipeline.grade(body.quiz, body.question, body.answer)
        return None
    if len(canonical(body.answer)) > TEXT_BYTES_MAX:
        raise TooLarge(f"The answer is too long; at most {TEXT_BYTES_MAX // 1024} KB are taken.")
    return pipeline.grade(body.quiz, body.question, body.answer)


def next_attempt(session: Session, who: Identity, body: AnswerBody, question: Question) -> int:
    """The number of the learner's next go. Raises Conflict where none is left."""
    used = submissions.attempts_at(session, Chosen(who.course, who.user, body.quiz, body.question))
    if question.attempts is not None and used >= question.attempts:
        raise Conflict(f"All {question.attempts} attempts at this question are used up.")
    return used + 1


def refuse_flood(session: Session, who: Identity, queue_max: int) -> None:
    """One learner's scripts may not hold up everybody else's. Raises TooManyRequests."""
    if submissions.pending(session, Chosen(who.course, who.user)) > queue_max:
        raise TooManyRequests(f"{queue_max} of your scripts are still waiting; wait for their verdicts.", RETRY_S)


def replay(session: Session, earlier: IdempotencyKey, digest: str) -> Receipt:
    """What the first request with this key made. Raises Unprocessable where that was another request."""
    if earlier.request_digest != digest:
        raise Unprocessable("This Idempotency-Key was used for another request.")
    submission = session.get_one(Submission, earlier.submission_id)
    verdict = submissions.verdicts(session, [submission]).get(submission.id)
    return Receipt(submission, verdict, earlier.http_status)


def remember(who: Identity, key: str, digest: str, submission: Submission, http_status: int) -> IdempotencyKey:
    """The row by which a repeated request is recognised."""
    return IdempotencyKey(
        course=who.course,
        user=who.user,
        key=key,
        request_digest=digest,
        submission_id=submission.id,
        http_status=http_status,
    )
