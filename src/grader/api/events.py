"""`/submissions/{id}/events`: the events of a submission as a stream."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, HTTPException
from fastapi.concurrency import run_in_threadpool
from fastapi.encoders import jsonable_encoder
from fastapi.sse import EventSourceResponse, ServerSentEvent

from grader.api.context import AppContext, Context, Learner
from grader.api.problems import documented
from grader.api.submissions import view_for, visible
from grader.courses.standing import standing_of
from grader.identity import Identity
from grader.store import submissions
from grader.store.tables import Event, Submission

router = APIRouter()

LOOK_S = 15.0
"""Pause between two looks into the database where no event is announced [s]."""


@dataclass(frozen=True)
class Listener:
    """An open stream; `last` is the number of the last event that the listener already has."""

    context: Context
    who: Identity
    submission_id: str
    last: int


def listen(
    submission_id: str, who: Learner, context: AppContext, last_event_id: Annotated[str | None, Header()] = None
) -> Listener:
    """Opens a stream. Raises NotFound, and 204 if no event can follow, which makes a browser stop asking."""
    last = int(last_event_id) if last_event_id and last_event_id.isdecimal() and len(last_event_id) < 10 else 0
    with context.database.read() as session:
        submission = visible(session, submission_id, who)
        over = submission.status in submissions.AT_REST
        last = min(last, submissions.last_event(session, submission_id))
        if over and not submissions.events_after(session, submission_id, last):
            raise HTTPException(204)
    return Listener(context, who, submission_id, last)


@router.get(
    "/submissions/{submission_id}/events",
    response_class=EventSourceResponse,
    responses=documented(401, 403, 404, 422, 429, more={204: {"description": "No more events"}}),
)
async def follow(listener: Annotated[Listener, Depends(listen)]) -> AsyncIterator[ServerSentEvent]:
    """Every event since `Last-Event-ID`, then those to come; the last is `graded` or `needs_review`."""
    last, over = listener.last, False
    loop, changed = asyncio.get_running_loop(), asyncio.Event()
    signals = listener.context.database.signals

    def wake() -> None:
        loop.call_soon_threadsafe(changed.set)

    with signals.listening(submissions.EVENTS, wake, listener.submission_id):
        while not over:
            changed.clear()
            events, shown, over = await run_in_threadpool(read_events, listener, last)
            for event in events:
                last = event.number
                data = event_data(event, shown)
                yield ServerSentEvent(id=str(event.number), event=event_name(event, shown), data=data)
            if not over:
                with suppress(TimeoutError):
                    await asyncio.wait_for(changed.wait(), LOOK_S)


def read_events(listener: Listener, last: int) -> tuple[list[Event], dict[str, Any], bool]:
    """The events after number `last`, the submission as it is now, and whether no more will come."""
    library = listener.context.content.of(listener.who.course).library
    with listener.context.database.read() as session:
        submission = session.get_one(Submission, listener.submission_id)
        over = submission.status in submissions.AT_REST
        events = list(submissions.events_after(session, submission.id, last))
        verdict = submissions.verdicts(session, [submission]).get(submission.id) if over else None
        standing = standing_of(session, library, listener.who, (submission.quiz, submission.question))
        shown = jsonable_encoder(view_for(standing, submission, verdict, with_answer=False))
    return events, shown, over


def event_name(event: Event, shown: dict[str, Any]) -> str:
    """The name of an event: that of a withheld verdict is `needs_review`, as is the status that is shown."""
    withheld = event.name in submissions.AT_REST and shown["status"] == submissions.NEEDS_REVIEW
    return submissions.NEEDS_REVIEW if withheld else event.name


def event_data(event: Event, shown: dict[str, Any]) -> dict[str, Any]:
    """The data of an event: the submission with its verdict once it is graded, before that its id and status."""
    if event.name in submissions.AT_REST:
        return shown
    return {"id": event.submission_id, "status": event.name}
