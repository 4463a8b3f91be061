"""Every query on the members of courses."""

from collections.abc import Iterable, Sequence

from sqlalchemy import delete, exists, func, select
from sqlalchemy.orm import Session

from grader.store.tables import Credential, Member, Submission


def get(session: Session, member_id: str, course: str) -> Member | None:
    """The member of this id in the course, unless it was removed."""
    wanted = select(Member).where(Member.id == member_id, Member.course == course, Member.removed_at.is_(None))
    return session.scalar(wanted)


def with_account(session: Session, course: str, account: str) -> Member | None:
    """The member with this account, also a removed one."""
    return session.scalar(select(Member).where(Member.course == course, Member.account == account))


def page(session: Session, course: str, after: str | None, limit: int) -> Sequence[Member]:
    """At most `limit` members in the order of their ids, beginning after the id `after`; removed ones are left out."""
    wanted = select(Member).where(Member.course == course, Member.removed_at.is_(None))
    if after is not None:
        wanted = wanted.where(Member.id > after)
    return session.scalars(wanted.order_by(Member.id).limit(limit)).all()


def sharing_email(session: Session, course: str, members: Sequence[Member]) -> dict[str, list[str]]:
    """For those of the members whose e-mail address others of the course have too: the ids of the others."""
    asked = {member.id: member.email.lower() for member in members if member.email}
    if not asked:
        return {}
    address = func.lower(Member.email)
    here = (Member.course == course, Member.removed_at.is_(None), address.in_(set(asked.values())))
    owners: dict[str, list[str]] = {}
    for member_id, email in session.execute(select(Member.id, address).where(*here).order_by(Member.id)):
        owners.setdefault(email, []).append(member_id)
    others = {one: [other for other in owners.get(email, ()) if other != one] for one, email in asked.items()}
    return {one: found for one, found in others.items() if found}


def everybody(session: Session, course: str) -> Sequence[Member]:
    """All members of a course by name, with those who were removed."""
    return session.scalars(select(Member).where(Member.course == course).order_by(Member.name, Member.id)).all()


def prune(session: Session, member_ids: Iterable[str]) -> None:
    """Deletes those of the members that have no account, no credential and no submission."""
    has_credential = exists().where(Credential.member == Member.id)
    has_submission = exists().where(Submission.course == Member.course, Submission.learner == Member.id)
    lost = (Member.id.in_(set(member_ids)), Member.account.is_(None), ~has_credential, ~has_submission)
    session.execute(delete(Member).where(*lost).execution_options(synchronize_session=False))
