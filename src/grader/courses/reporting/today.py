"""What needs a person in a course: answers to review, marks that differ, and results that did not arrive."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy.orm import Session

from grader.courses.people.identity import Identity
from grader.courses.reviewing import reviews
from grader.courses.reviewing.desk import Desk
from grader.store import outbox
from grader.store.outbox import DEAD, Delivery
from grader.store.reviewing import reviews as stored
from grader.store.reviewing.reviews import WaitingQuestion
from grader.store.submissions import SubmissionFilter

COUNTED_MAX = 1000
"""Answers that are counted of each kind; the oldest ones."""

DEAD_SHOWN = 20


@dataclass(frozen=True)
class Today:
    """What waits for a person, by question; `second` for a second mark by this instructor, `dead` to be sent again."""

    first: Sequence[WaitingQuestion]
    second: Sequence[WaitingQuestion]
    differing: Sequence[WaitingQuestion]
    dead: Sequence[tuple[Delivery, str]]
    """At most `DEAD_SHOWN` deliveries, each with the kind of its destination."""
    more_dead: bool


def read_today(desk: Desk, session: Session, who: Identity) -> Today:
    """Says what waits in the course of an instructor. Reads at most `COUNTED_MAX` answers of each kind."""
    wanted = SubmissionFilter(who.course)
    here = (Delivery.course == who.course, Delivery.state == DEAD)
    dead = outbox.page(session, here, 0, DEAD_SHOWN + 1)
    return Today(
        stored.count_waiting(session, reviews.list_queue(desk, session, wanted), COUNTED_MAX),
        stored.count_waiting(session, reviews.list_queue(desk, session, wanted, who.id), COUNTED_MAX),
        stored.count_differing(session, who.course, COUNTED_MAX, who.id),
        dead[:DEAD_SHOWN],
        len(dead) > DEAD_SHOWN,
    )
