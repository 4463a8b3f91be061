"""`/submissions/{id}/events`: what happens to a submission, as it happens."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, HTTPException
from fastapi.concurrency import run_in_threadpool
from fastapi.encoders import jsonable_encoder
from fastapi.sse import EventSourceResponse, ServerSentEvent

from grader.api.context import AppContext, Context, Learner
from grader.api.problems import documented
from grader.api.submissions import view, visible
from grader.store import submissions
from grader.store.tables import Event, Submission

router = APIRouter()

POLL_S = 0.2
"""How soon a listener hears of what another process did [s]."""


@dataclass(frozen=True)
class Listener:
    """Somebody who has heard the events of a submission up to the `heard`-th."""

    context: Context
    submission_id: str
    heard: int


def listen(
    submission_id: str, who: Learner, context: AppContext, last_event_id: Annotated[str | None, Header()] = None
) -> Listener:
    """Raises NotFound, and 204 where nothing can follow any more: it tells a browser to stop asking."""
    heard = int(last_event_id) if last_event_id and last_event_id.isdecimal() and len(last_event_id) < 10 else 0
    with context.database.read() as session:
        submission = visible(session, submission_id, who)
        over = submission.status in submissions.AT_REST
        heard = min(heard, submissions.last_event(session, submission_id))
        if over and not submissions.events_after(session, submission_id, heard):
            raise HTTPException(204)
    return Listener(context, submission_id, heard)


@router.get(
    "/submissions/{submission_id}/events",
    response_class=EventSourceResponse,
    responses=documented(401, 403, 404, 422, 429, more={204: {"description": "Nothing more will come"}}),
)
async def follow(listener: Annotated[Listener, Depends(listen)]) -> AsyncIterator[ServerSentEvent]:
    """Every event since `Last-Event-ID`, then those to come; the last is `graded` or `needs_review`."""
    heard, over = listener.heard, False
    while not over:
        events, shown, over = await run_in_threadpool(news, listener, heard)
        for event in events:
            heard = event.number
            yield ServerSentEvent(id=str(event.number), event=event.name, data=told(event, shown))
        if not over:
            await asyncio.sleep(POLL_S)


def news(listener: Listener, heard: int) -> tuple[list[Event], dict[str, Any], bool]:
    """Events after the `heard`-th, the submission as it now is, and whether that is all."""
    with listener.context.database.read() as session:
        submission = session.get_one(Submission, listener.submission_id)
        over = submission.status in submissions.AT_REST
        events = list(submissions.events_after(session, submission.id, heard))
        verdict = submissions.verdicts(session, [submission]).get(submission.id) if over else None
        shown = jsonable_encoder(view(submission, verdict, with_answer=False))
    return events, shown, over


def told(event: Event, shown: dict[str, Any]) -> dict[str, Any]:
    """What an event says: the whole submission with its verdict when it is graded, before that only its state."""
    if event.name in submissions.AT_REST:
        return shown
    return {"id": event.submission_id, "status": event.name}
