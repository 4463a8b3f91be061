"""Saved comments: texts that the reviewers of a question use again."""

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity
from grader.errors import Conflict, NotFound, Unprocessable
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from grader.store.reviewing.reviews import count_comments, find_comment
from grader.store.tables import SavedComment, now

COMMENTS_MAX = 200
"""For one question of a course."""

CHARACTERS_MAX = 2000
"""Of a saved comment."""

REVIEW_CHARACTERS_MAX = 10_000
"""Of the comment of a review."""


def save(database: Database, session: Session, who: Identity, at: tuple[str, str], text: str) -> SavedComment:
    """Saves a comment for a (quiz, question). Raises Conflict if it has `COMMENTS_MAX`."""
    database.lock(session, f"comments\n{who.course}")
    quiz, question = at
    if count_comments(session, who.course, quiz, question) >= COMMENTS_MAX:
        raise Conflict(f"{COMMENTS_MAX} comments are saved for this question: delete one first.")
    comment = SavedComment(
        id=make_id(), course=who.course, quiz=quiz, question=question, text=text, saved_by=who.user, saved_at=now()
    )
    session.add(comment)
    record(session, who, who.course, Action.COMMENT_SAVED, comment.id, quiz=quiz, question=question)
    return comment


def check(text: str) -> None:
    """Raises Unprocessable for a text that cannot be saved."""
    if not 1 <= len(text) <= CHARACTERS_MAX:
        raise Unprocessable(f"A saved comment has 1 to {CHARACTERS_MAX} characters.")


def change(session: Session, who: Identity, comment_id: str, text: str) -> SavedComment:
    """Changes the text of a comment. Raises NotFound."""
    comment = get_comment(session, who, comment_id)
    comment.text, comment.saved_by, comment.saved_at = text, who.user, now()
    record(session, who, who.course, Action.COMMENT_CHANGED, comment.id)
    return comment


def delete(session: Session, who: Identity, comment_id: str) -> None:
    """Deletes a comment; the reviews that used it stay. Raises NotFound."""
    comment = get_comment(session, who, comment_id)
    session.delete(comment)
    record(session, who, who.course, Action.COMMENT_DELETED, comment.id)


def get_comment(session: Session, who: Identity, comment_id: str) -> SavedComment:
    """Returns the comment of the caller's course. Raises NotFound."""
    comment = find_comment(session, comment_id, who.course) if comment_id.isalnum() else None
    if comment is None:
        raise NotFound("There is no such comment.")
    return comment
