"""The events of submissions: their new statuses, and the cases that their scripts are at."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import String, bindparam, func, insert, select
from sqlalchemy.orm import Session

from grader.domain.progress import TrialProgress
from grader.store.engine.bulk import UtcDateTime
from grader.store.engine.signals import announce
from grader.store.tables import Event, now

EVENTS = "events"
"""The channel on which new events are announced, by submission."""

AT_CASE = re.compile(r"case (\d+) of (\d+)|(\d+)/(\d+) (ep|s) (\d+)/(\d+)")
"""The name of an event that tells how far a running script is: at a case, or also at an episode or a second of it. A
name has at most 20 characters."""

NEW_EVENT = insert(Event).from_select(
    ["submission_id", "number", "name", "created_at"],
    select(
        bindparam("of", type_=String),
        1 + func.coalesce(func.max(Event.number), 0),
        bindparam("called", type_=String),
        bindparam("at", type_=UtcDateTime),
    ).where(Event.submission_id == bindparam("of", type_=String)),
)


def add_event(session: Session, submission_id: str, name: str) -> None:
    """Adds an event, and announces it."""
    session.connection().execute(NEW_EVENT, {"of": submission_id, "called": name, "at": now()})
    announce(session, EVENTS, submission_id)


def name_case(case: int, cases: int, within: TrialProgress | None) -> str:
    """Returns the name of an event that tells which case a running script is at, and how far in it."""
    if within is None:
        return f"case {case} of {cases}"
    return f"{case}/{cases} {'ep' if within.unit == 'episode' else 's'} {within.at}/{within.of}"


@dataclass(frozen=True)
class CaseProgress:
    """How far a running script is: at a case of so many, and within it."""

    case: int
    cases: int
    within: TrialProgress | None = None

    @property
    def words(self) -> str:
        """As it is shown: `case 2 of 7, episode 3 of 20`."""
        return f"case {self.case} of {self.cases}" + (f", {self.within.words}" if self.within else "")


def read_case(event: Event | None) -> CaseProgress | None:
    """How far the script is that an event tells of; None for other events."""
    match = None if event is None else AT_CASE.fullmatch(event.name)
    if match is None:
        return None
    if match[1]:
        return CaseProgress(int(match[1]), int(match[2]))
    within = TrialProgress(int(match[6]), int(match[7]), "episode" if match[5] == "ep" else "s")
    return CaseProgress(int(match[3]), int(match[4]), within)


EVENTS_AFTER = (
    select(Event)
    .where(Event.submission_id == bindparam("of"), Event.number > bindparam("after"))
    .order_by(Event.number)
)


def events_after(session: Session, submission_id: str, number: int) -> Sequence[Event]:
    """The submission's events after event `number`, in order."""
    return session.scalars(EVENTS_AFTER, {"of": submission_id, "after": number}).all()


def last_event(session: Session, submission_id: str) -> int:
    """The number of the submission's newest event; 0 if there is none."""
    return session.scalar(select(func.max(Event.number)).where(Event.submission_id == submission_id)) or 0


def case_now(session: Session, submission_id: str) -> CaseProgress | None:
    """The case that a running script is at, as far as its newest event tells."""
    newest = select(Event).where(Event.submission_id == submission_id).order_by(Event.number.desc()).limit(1)
    return read_case(session.scalar(newest))
