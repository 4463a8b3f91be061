"""Every query on the members of courses."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, delete, exists, func, or_, select
from sqlalchemy.orm import Session

from grader.store.engine.names import Folded, holds
from grader.store.tables import Credential, Member, Result, Submission


def get(session: Session, member_id: str, course: str) -> Member | None:
    """The member of this id in the course, unless it was removed."""
    wanted = select(Member).where(Member.id == member_id, Member.course == course, Member.removed_at.is_(None))
    return session.scalar(wanted)


def find(session: Session, member_id: str, course: str) -> Member | None:
    """The member of this id in the course, also a removed one."""
    return session.scalar(select(Member).where(Member.id == member_id, Member.course == course))


def find_with_account(session: Session, course: str, account: str) -> Member | None:
    """The member with this account, also a removed one."""
    return session.scalar(select(Member).where(Member.course == course, Member.account == account))


def page(session: Session, course: str, after: str | None, limit: int) -> Sequence[Member]:
    """At most `limit` members in the order of their ids, beginning after the id `after`; removed ones are left out."""
    wanted = select(Member).where(Member.course == course, Member.removed_at.is_(None))
    if after is not None:
        wanted = wanted.where(Member.id > after)
    return session.scalars(wanted.order_by(Member.id).limit(limit)).all()


def list_removed(session: Session, course: str) -> set[str]:
    """The ids of the members who were removed from a course."""
    return set(session.scalars(select(Member.id).where(Member.course == course, Member.removed_at.is_not(None))))


def sharing_email(session: Session, course: str, members: Sequence[Member]) -> dict[str, list[str]]:
    """For those of the members whose e-mail address others of the course have too: the ids of the others."""
    emails = {member.id: member.email.lower() for member in members if member.email}
    if not emails:
        return {}
    address = func.lower(Member.email)
    here = (Member.course == course, Member.removed_at.is_(None), address.in_(set(emails.values())))
    owners: dict[str, list[str]] = {}
    for member_id, email in session.execute(select(Member.id, address).where(*here).order_by(Member.id)):
        owners.setdefault(email, []).append(member_id)
    others = {id_: [other for other in owners.get(email, ()) if other != id_] for id_, email in emails.items()}
    return {id_: sharers for id_, sharers in others.items() if sharers}


def list_members(session: Session, course: str) -> Sequence[Member]:
    """All members of a course by name, with those who were removed."""
    return session.scalars(select(Member).where(Member.course == course).order_by(Member.name, Member.id)).all()


ENROLLED = (Member.id, Member.name, Member.role, Member.account, Member.namespace, Member.external_id, Member.email)


def list_enrolled(session: Session, course: str) -> Sequence[Any]:
    """The columns `ENROLLED` of the students and instructors of a course, by name; removed ones are left out."""
    here = (Member.course == course, Member.role != "service", Member.removed_at.is_(None))
    return session.execute(select(*ENROLLED).where(*here).order_by(Member.name, Member.id)).all()


def list_learners(session: Session, course: str, limit: int | None = None) -> Sequence[Member]:
    """At most `limit` learners of a course, by name; removed ones are left out."""
    here = (Member.course == course, Member.role == "student", Member.removed_at.is_(None))
    return session.scalars(select(Member).where(*here).order_by(Folded(Member.name), Member.id).limit(limit)).all()


def list_with_home(session: Session, home: str) -> Sequence[Member]:
    """The members of other courses who are the same person as the member with this id, by course; removed ones are left
    out."""
    theirs = select(Member).where(Member.home == home, Member.removed_at.is_(None))
    return session.scalars(theirs.order_by(Folded(Member.course), Member.id)).all()


def list_courses(session: Session) -> list[str]:
    """The names of all courses that have a member, also of removed ones."""
    return list(session.scalars(select(Member.course).distinct().order_by(Member.course)))


def count_learners(session: Session, courses: Iterable[str]) -> dict[str, int]:
    """How many learners each of the courses has; one without is left out. Removed ones do not count."""
    here = (Member.course.in_(list(courses)), Member.role == "student", Member.removed_at.is_(None))
    counts = select(Member.course, func.count()).where(*here).group_by(Member.course)
    return {row[0]: row[1] for row in session.execute(counts)}


@dataclass(frozen=True)
class MemberFilter:
    """Which members of a course: whose name or e-mail address holds the text `find`, and who have this role. Empty
    means all."""

    find: str = ""
    role: str = ""

    def select_in(self, course: str) -> list[ColumnElement[bool]]:
        """Returns the conditions on the members of a course; removed ones are left out."""
        here = [Member.course == course, Member.removed_at.is_(None)]
        if self.find:
            here.append(or_(holds(Member.name, self.find), holds(func.coalesce(Member.email, ""), self.find)))
        if self.role:
            here.append(Member.role == self.role)
        return here


ALL_MEMBERS = MemberFilter()


def list_by_name(
    session: Session, course: str, start: int, limit: int, wanted: MemberFilter = ALL_MEMBERS
) -> Sequence[Member]:
    """At most `limit` members in the order of their names, after the first `start`."""
    rows = select(Member).where(*wanted.select_in(course)).order_by(Folded(Member.name), Member.id)
    return session.scalars(rows.offset(start).limit(limit)).all()


def count(session: Session, course: str, wanted: MemberFilter = ALL_MEMBERS) -> int:
    """Says how many members of a course there are."""
    return session.scalar(select(func.count()).select_from(Member).where(*wanted.select_in(course))) or 0


def list_bearers(session: Session, course: str, name: str) -> Sequence[Member]:
    """The members of a course who bear a name, by id; removed ones are left out."""
    here = (Member.course == course, Member.name == name, Member.removed_at.is_(None))
    return session.scalars(select(Member).where(*here).order_by(Member.id)).all()


def count_bearers(session: Session, course: str, name: str) -> int:
    """How many members of a course bear a name; removed ones do not count."""
    here = (Member.course == course, Member.name == name, Member.removed_at.is_(None))
    return session.scalar(select(func.count()).select_from(Member).where(*here)) or 0


def find_namesakes(session: Session, course: str) -> Sequence[str]:
    """The ids of the members of a course whose name another bears too; removed ones count."""
    shared = select(Member.name).where(Member.course == course).group_by(Member.name).having(func.count() > 1)
    return session.scalars(select(Member.id).where(Member.course == course, Member.name.in_(shared))).all()


def list_without_results(
    session: Session, course: str, quizzes: Sequence[str], find: str = "", limit: int | None = None
) -> Sequence[Member]:
    """At most `limit` learners of a course without a result in these quizzes, by name. Those whom only a browser
    session knows are left out: they may merely have opened a page. `find` is a part of the name, in any case."""
    here = (Member.course == course, Member.role == "student", Member.removed_at.is_(None), Member.account.is_not(None))
    begun = exists().where(Result.course == Member.course, Result.learner == Member.id, Result.quiz.in_(quizzes))
    wanted = select(Member).where(*here, ~begun).order_by(Folded(Member.name), Member.id).limit(limit)
    if find:
        wanted = wanted.where(holds(Member.name, find))
    return session.scalars(wanted).all()


def prune(session: Session, member_ids: Iterable[str]) -> None:
    """Deletes those of the members that have no account, no credential and no submission."""
    has_credential = exists().where(Credential.member == Member.id)
    has_submission = exists().where(Submission.course == Member.course, Submission.learner == Member.id)
    lost = (Member.id.in_(set(member_ids)), Member.account.is_(None), ~has_credential, ~has_submission)
    session.execute(delete(Member).where(*lost).execution_options(synchronize_session=False))
