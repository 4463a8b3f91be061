"""`/submissions/{id}/events`: the events of a submission as a stream."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends, Header, HTTPException
from fastapi.concurrency import run_in_threadpool
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic_core import to_json
from sqlalchemy.orm import Session

from grader.api.learning.submissions import describe_for, find_visible, read_seen
from grader.courses.answering.access import LearnerAccess, read_access
from grader.courses.people.identity import Identity, still_holds
from grader.courses.rules.policy import Visibility
from grader.gate.callers import Learner, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services
from grader.store import submissions
from grader.store.engine.database import AWAY
from grader.store.events import EVENTS, events_after, last_event, read_case
from grader.store.tables import Event, Submission

router = api_router("submissions")

PROGRESS = "progress"
"""The name of events that tell how far a script is."""

LOOK_S = 60.0
"""Pause between two looks into the database where no event is announced [s]. All events are: this is for our faults."""


@dataclass(frozen=True)
class Listener:
    """An open stream; `last` is the number of the last event that the listener already has."""

    services: Services
    who: Identity
    submission_id: str
    last: int


def listen(
    submission_id: str, who: Learner, services: AppServices, last_event_id: Annotated[str | None, Header()] = None
) -> Listener:
    """Opens a stream. Raises NotFound, and 204 if no event can follow, which makes a browser stop asking."""
    last = int(last_event_id) if last_event_id and last_event_id.isdecimal() and len(last_event_id) < 10 else 0
    with services.database.read() as session:
        submission = find_visible(session, submission_id, who)
        if last:  # else the first event is still to be told
            last = min(last, last_event(session, submission_id))
            access = read_access_to(session, services, who, submission)
            if submission.status in submissions.AT_REST and not events_shown(session, access, submission, last):
                raise HTTPException(204)
    return Listener(services, who, submission_id, last)


@router.get(
    "/submissions/{submission_id}/events",
    response_class=EventSourceResponse,
    responses=refusals(401, 403, 404, 422, 429, more={204: {"description": "No more events"}}),
)
async def follow_events(listener: Annotated[Listener, Depends(listen)]) -> AsyncIterator[ServerSentEvent]:
    """Every event since `Last-Event-ID`, then those to come; the last is `graded` or `needs_review`."""
    last, over, user = listener.last, False, listener.who.id
    loop, streams = asyncio.get_running_loop(), listener.services.streams
    signals = listener.services.database.signals

    def wake() -> None:
        loop.call_soon_threadsafe(changed.set)

    with streams.open(user) as changed, signals.listening(EVENTS, wake, listener.submission_id):
        while not over and streams.is_open(user, changed):
            changed.clear()
            try:
                events, over = await run_in_threadpool(read_events, listener, last)
            except AWAY:  # when the database is back, every listener is called
                events = []
            for event in events:
                last = int(event.id or last)
                yield event
            if not over:
                with suppress(TimeoutError):
                    await asyncio.wait_for(changed.wait(), LOOK_S)


def read_events(listener: Listener, last: int) -> tuple[list[ServerSentEvent], bool]:
    """The events after number `last`, as they are sent, and whether no more will come; none to a revoked token."""
    with listener.services.database.read() as session:
        if not still_holds(session, listener.who):
            return [], True
        submission = session.get_one(Submission, listener.submission_id)
        over, shown = submission.status in submissions.AT_REST, dict[str, Any]()
        if over:
            access = read_access_to(session, listener.services, listener.who, submission)
            events = events_shown(session, access, submission, last)
            blind = read_seen(session, listener.services, listener.who, [submission])
            verdict, name = blind.verdicts.get(submission.id), blind.names.get(submission.id)
            decision = access.decide(submission.quiz, submission.question)
            shown = describe_for(decision, submission, verdict, name, with_answer=False)
        else:  # a verdict that PostgreSQL has committed meanwhile is announced, and read then
            later = events_after(session, submission.id, last)
            events = [event for event in later if event.name not in submissions.AT_REST]
    return [serialise_event(event, shown) for event in events], over


def read_access_to(session: Session, services: Services, who: Identity, submission: Submission) -> LearnerAccess:
    """The access of a user at the question of a submission."""
    library = services.content.get(who.course).library
    return read_access(session, library, who, (submission.quiz, submission.question))


def serialise_event(event: Event, shown: dict[str, Any]) -> ServerSentEvent:
    """An event as it is sent. Its JSON is made here, in the thread that reads, and not while the event loop waits."""
    data = to_json(event_data(event, shown), inf_nan_mode="null").decode()
    return ServerSentEvent(id=str(event.number), event=event_name(event, shown), raw_data=data)


def events_shown(session: Session, access: LearnerAccess, submission: Submission, last: int) -> list[Event]:
    """The events after number `last` that the user may see: before the feedback, none after the first verdict."""
    if access.decide(submission.quiz, submission.question).shown is not Visibility.RECEIPT:
        return list(events_after(session, submission.id, last))
    events = events_after(session, submission.id, 0)
    first = next((event.number for event in events if event.name in submissions.AT_REST), len(events))
    return [event for event in events if last < event.number <= first]


def event_name(event: Event, shown: dict[str, Any]) -> str:
    """The name of an event: that of a withheld verdict is `needs_review`, as is the status that is shown."""
    if read_case(event):
        return PROGRESS
    withheld = event.name in submissions.AT_REST and shown["status"] == submissions.NEEDS_REVIEW
    return submissions.NEEDS_REVIEW if withheld else event.name


def event_data(event: Event, shown: dict[str, Any]) -> dict[str, Any]:
    """The data of an event: the submission with its verdict once it is graded, before that its id and status. Of a
    script that takes long, also the number of the case that it is at, and of all cases; of a long case, `within`."""
    if event.name in submissions.AT_REST:
        return shown
    if at := read_case(event):
        where = {"case": at.case, "cases": at.cases, **({"within": at.within.words} if at.within else {})}
        return {"id": event.submission_id, "status": submissions.RUNNING, **where}
    return {"id": event.submission_id, "status": event.name}
