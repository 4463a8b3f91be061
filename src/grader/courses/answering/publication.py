"""Publishes the feedback of a quiz with `"feedback": "after_publish"`, and withholds it again."""

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity
from grader.courses.sending import outbox
from grader.store import extensions
from grader.store.engine.database import Database


def publish(database: Database, session: Session, who: Identity, quiz: str) -> None:
    """Learners see how they were graded, and platforms get what was held back."""
    extensions.publish(session, who.course, quiz, who.user)
    outbox.release(database, session, who.course, quiz)
    record(session, who, who.course, Action.PUBLISHED, quiz)


def withdraw(session: Session, who: Identity, quiz: str) -> None:
    """Withholds the feedback again."""
    extensions.withdraw(session, who.course, quiz)
    record(session, who, who.course, Action.WITHDRAWN, quiz)
