"""Tells learners of one name apart: by a short mark, the end of the id, which never changes."""

from collections.abc import Mapping

from sqlalchemy.orm import Session

from grader.store import people

DIGITS = 4
"""Digits of the id in a mark."""


def make_marks(session: Session, course: str) -> Mapping[str, str]:
    """Returns the marks of the members of a course whose name another bears too, by id; of removed ones as well."""
    return {namesake: make_mark(namesake) for namesake in people.find_namesakes(session, course)}


def make_mark(member: str) -> str:
    """Returns the mark of the member with this id, such as `…7f3a`."""
    return f"…{member[-DIGITS:]}"


def mark_name(name: str, member: str | None, marks: Mapping[str, str]) -> str:
    """Returns a name with its mark, if it has one, as plain text."""
    return f"{name} {marks[member]}" if member is not None and member in marks else name
