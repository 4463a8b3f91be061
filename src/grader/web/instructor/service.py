"""`/instructor/service`: whether workers live, how long the queue is, and results that did not arrive. No script."""

from typing import Any

from fastapi import Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.people.identity import Identity
from grader.courses.sending import outbox
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.queue import jobs
from grader.store import outbox as stored
from grader.store.outbox import DEAD, Delivery
from grader.web.frame.inputs import Instructor, RowId, Visitor
from grader.web.frame.rendering import page
from grader.web.learner.pages import show_sign_in
from grader.web.text.numbers import write_span

PAGE = "/instructor/service"
DEAD_SHOWN = 100

TOPICS = {
    jobs.GRADE: "Scripts to grade",
    jobs.REGRADE: "Pieces of regrades",
    jobs.DELIVER: "Results to send",
    jobs.PRUNE: "Old records to delete",
}

router = page_router()


@router.get(PAGE)
def show(request: Request, services: AppServices, who: Visitor) -> Response:
    """The workers, the queue of the installation, and the course's dead letters; else how to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    with services.database.read() as session:
        alive, rows = services.monitor.workers_alive(session), list_queue(session)
        dead = list_dead(session, who)
        states = stored.count_in_course(session, who.course)
    shown: dict[str, Any] = {"dead": dead[:DEAD_SHOWN], "more_dead": len(dead) > DEAD_SHOWN, "states": states}
    return page(request, "service.html", who=who, alive=alive, rows=rows, **shown)


def list_queue(session: Session) -> list[tuple[str, int, int, str]]:
    """Says what waits and runs, by topic in order of priority, and for how long the oldest job has waited."""
    queue = jobs.read_state(session)
    return [
        (words, queue[topic].waiting, queue[topic].running, "" if age is None else write_span(age))
        for topic, words in TOPICS.items()
        for age in [queue[topic].oldest_s]
    ]


def list_dead(session: Session, who: Identity) -> list[tuple[Delivery, str]]:
    """Returns the dead letters of the course, one more than are shown, each with the kind of its destination."""
    here = (Delivery.course == who.course, Delivery.state == DEAD)
    return list(stored.page(session, here, 0, DEAD_SHOWN + 1))


@router.post(f"{PAGE}/deliveries/{{delivery_id}}/replay")
def replay(delivery_id: RowId, services: AppServices, who: Instructor) -> Response:
    """Sends a result again that did not arrive. Raises Unauthorized, Forbidden, NotFound, Conflict."""
    with services.database.write() as session:
        outbox.replay(session, who, delivery_id, who.course)
    return RedirectResponse(PAGE, 303)
