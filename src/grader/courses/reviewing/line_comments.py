"""Comments on lines of scripts: instructors write them, the learner sees them below the line. They change no points."""

import json
from collections.abc import Sequence

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity
from grader.errors import NotFound, Unprocessable
from grader.store.reviewing import line_comments
from grader.store.reviewing.line_comments import LineComment
from grader.store.tables import ERASED, Submission

CHARACTERS_MAX = 2000
"""Longest comment."""
COMMENTS_MAX = 100
"""Comments on one script, at most."""


def write_comment(
    session: Session, who: Identity, rows: Sequence[tuple[Submission, int | None]], text: str
) -> list[LineComment]:
    """Writes one comment to several scripts of the instructor's course, each at its line, or as a whole without one.
    Raises NotFound for what is none of the course, Unprocessable for an empty or long text, and for what is no script
    or has no such line."""
    text = text.strip()
    if not text:
        raise Unprocessable("Write the comment first.")
    if len(text) > CHARACTERS_MAX:
        raise Unprocessable(f"A comment on a script has at most {CHARACTERS_MAX} characters.")
    there = line_comments.on_submissions(session, [row.id for row, _ in rows])
    written = []
    for row, line in rows:
        if row.course != who.course or not who.is_instructor:
            raise NotFound("There is no such submission.")
        count = len(read_source(row).splitlines())
        if line is not None and not 1 <= line <= count:
            raise Unprocessable(f"The script has no line {line}: it has {count}.")
        if len(there.get(row.id, ())) >= COMMENTS_MAX:
            raise Unprocessable(f"A script has at most {COMMENTS_MAX} comments.")
        written.append(
            LineComment(course=row.course, submission_id=row.id, line=line, text=text, author=who.id, name=who.user)
        )
        record(session, who, who.course, Action.LINE_COMMENTED, row.id, line=line)
    session.add_all(written)
    session.flush()
    return written


def delete_comment(session: Session, who: Identity, comment_id: str, submission_id: str) -> None:
    """Deletes a comment on a script of the instructor's course. Raises NotFound."""
    comment = line_comments.find(session, comment_id, who.course) if who.is_instructor else None
    if comment is None or comment.submission_id != submission_id:
        raise NotFound("There is no such comment.")
    session.delete(comment)
    record(session, who, who.course, Action.LINE_COMMENT_DELETED, submission_id, line=comment.line)


def read_source(row: Submission) -> str:
    """Returns the script of a submission. Raises Unprocessable where the answer is none."""
    answer = None if row.answer == ERASED else json.loads(row.answer)
    if not isinstance(answer, dict) or not isinstance(answer.get("source"), str):
        raise Unprocessable("This answer is no script: write a comment to it in its review.")
    return str(answer["source"])
