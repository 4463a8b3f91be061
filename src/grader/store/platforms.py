"""Learning platforms, and what their launches told: the tables and every query on them.

lti_platforms ──< lti_deployments      where the platform has installed this tool, approved or not
              ──< lti_contexts         its courses, linked with a course here or not
lti_contexts  ──< lti_resource_links   its links to this tool: a quiz, a question or the course, and the line item
              ──< lti_users            who has come from it, or is in its roster, and the member here
"""

import json
from collections.abc import Sequence
from datetime import datetime
from typing import Any, TypeVar

from sqlalchemy import ForeignKey, Index, String, Text, UniqueConstraint, delete, func, or_, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, Session, mapped_column

from grader.domain.platform import Platform, ScoreTarget
from grader.store.line_items import LineItem
from grader.store.outbox import Delivery, LinkedColumn, list_same_scores, make_scores_id
from grader.store.tables import NAME, Base, Credential, now

ID = 255
"""Longest identifier of a platform [characters]; LTI 1.3 says so for most of them."""

PENDING_MAX = 100
"""Deployments of one platform that wait for approval."""

UNCHANGED = {"synchronize_session": False}


class PlatformRow(Base):
    """A registered platform. Nobody comes from it until it is approved."""

    __tablename__ = "lti_platforms"
    __table_args__ = (UniqueConstraint("issuer", "client_id", name="uq_lti_platforms_client"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(NAME))
    issuer: Mapped[str] = mapped_column(String(ID))
    client_id: Mapped[str] = mapped_column(String(ID))
    login_url: Mapped[str] = mapped_column(Text)
    token_url: Mapped[str] = mapped_column(Text)
    keys_url: Mapped[str] = mapped_column(Text)
    token_audience: Mapped[str] = mapped_column(Text)
    origins: Mapped[str] = mapped_column(Text)
    """A JSON list."""
    created_at: Mapped[datetime] = mapped_column(default=now)
    approved_at: Mapped[datetime | None]


class Deployment(Base):
    """An installation of this tool on a platform."""

    __tablename__ = "lti_deployments"

    platform: Mapped[int] = mapped_column(ForeignKey("lti_platforms.id"), primary_key=True)
    deployment_id: Mapped[str] = mapped_column(String(ID), primary_key=True)
    created_at: Mapped[datetime] = mapped_column(default=now)
    approved_at: Mapped[datetime | None]


class Context(Base):
    """A platform's course, or with an empty `context_id` all that a deployment launches outside of courses."""

    __tablename__ = "lti_contexts"
    __table_args__ = (
        UniqueConstraint("platform", "deployment_id", "context_id", name="uq_lti_contexts_context"),
        Index("ix_lti_contexts_course", "course"),
        Index("ix_lti_contexts_wanted", "wanted"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    platform: Mapped[int] = mapped_column(ForeignKey("lti_platforms.id"))
    deployment_id: Mapped[str] = mapped_column(String(ID))
    context_id: Mapped[str] = mapped_column(String(ID))
    title: Mapped[str] = mapped_column(String(NAME))
    course: Mapped[str | None] = mapped_column(String(NAME))
    """The course here; None until it is linked."""
    wanted: Mapped[str | None] = mapped_column(String(NAME))
    """The course that an instructor of the platform asks for; its own instructors approve."""
    wanted_by: Mapped[str | None] = mapped_column(String(NAME))
    members_url: Mapped[str] = mapped_column(Text, default="")
    """Of the Names and Role Provisioning Service; empty without it."""
    created_at: Mapped[datetime] = mapped_column(default=now)


class ResourceLink(Base):
    """A link on a platform that leads here."""

    __tablename__ = "lti_resource_links"
    __table_args__ = (
        UniqueConstraint("context", "link_id", name="uq_lti_resource_links_link"),
        Index("ix_lti_resource_links_quiz", "quiz", "context"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    context: Mapped[int] = mapped_column(ForeignKey("lti_contexts.id"))
    link_id: Mapped[str] = mapped_column(String(ID))
    quiz: Mapped[str | None] = mapped_column(String(64))
    """None: the link leads to all quizzes of the course."""
    question: Mapped[str | None] = mapped_column(String(64))
    """None: the link leads to the whole quiz."""
    line_item_url: Mapped[str] = mapped_column(Text, default="")
    line_items_url: Mapped[str] = mapped_column(Text, default="")
    scopes: Mapped[str] = mapped_column(Text, default="")
    """Of the Assignment and Grade Services, separated by blanks."""


class LtiUser(Base):
    """A user of a platform's course, and the member who they are here."""

    __tablename__ = "lti_users"
    __table_args__ = (Index("ix_lti_users_member", "member"),)

    context: Mapped[int] = mapped_column(ForeignKey("lti_contexts.id"), primary_key=True)
    subject: Mapped[str] = mapped_column(String(ID), primary_key=True)
    member: Mapped[str] = mapped_column(ForeignKey("members.id"))
    seen_at: Mapped[datetime] = mapped_column(default=now)


Row = TypeVar("Row", bound=Base)


def read_platform(row: PlatformRow) -> Platform:
    """The platform that a row describes."""
    return Platform(
        row.id, row.issuer, row.client_id, row.login_url, row.token_url, row.keys_url, row.token_audience,
        tuple(json.loads(row.origins)),
    )  # fmt: skip


def get(session: Session, platform_id: int) -> PlatformRow | None:
    """The platform with this id."""
    return session.get(PlatformRow, platform_id)


def all_platforms(session: Session) -> Sequence[PlatformRow]:
    """Every platform, approved or not, in the order of registration."""
    return session.scalars(select(PlatformRow).order_by(PlatformRow.id)).all()


def find_registered(session: Session, issuer: str, client_id: str | None) -> Sequence[PlatformRow]:
    """The platforms of an issuer, or the one with this client id; at most two are looked for."""
    wanted = select(PlatformRow).where(PlatformRow.issuer == issuer).order_by(PlatformRow.id).limit(2)
    return session.scalars(wanted if client_id is None else wanted.where(PlatformRow.client_id == client_id)).all()


def add_once(session: Session, row: Row, query: Any) -> Row:
    """Adds a row, or returns what `query` selects: the row that another process has just added."""
    try:
        with session.begin_nested():
            session.add(row)
    except IntegrityError:
        earlier: Row = session.scalars(query).one()
        return earlier
    return row


def list_deployments(session: Session, platform_id: int) -> Sequence[Deployment]:
    """The deployments of a platform, oldest first."""
    return session.scalars(
        select(Deployment).where(Deployment.platform == platform_id).order_by(Deployment.created_at)
    ).all()


def note_deployment(session: Session, platform_id: int, deployment_id: str) -> Deployment | None:
    """The deployment; a new one waits for approval. None if too many wait."""
    query = select(Deployment).where(Deployment.platform == platform_id, Deployment.deployment_id == deployment_id)
    deployment = session.scalar(query)
    if deployment is not None:
        return deployment
    waiting = select(func.count()).where(Deployment.platform == platform_id, Deployment.approved_at.is_(None))
    if (session.scalar(waiting) or 0) >= PENDING_MAX:
        return None
    return add_once(session, Deployment(platform=platform_id, deployment_id=deployment_id), query)


def approve_deployments(session: Session, platform_id: int, deployment_id: str | None = None) -> int:
    """Approves one deployment of a platform, or all that wait. Returns how many."""
    waiting = select(Deployment).where(Deployment.platform == platform_id, Deployment.approved_at.is_(None))
    if deployment_id is not None:
        waiting = waiting.where(Deployment.deployment_id == deployment_id)
    deployments = session.scalars(waiting).all()
    for deployment in deployments:
        deployment.approved_at = now()
    return len(deployments)


def context_by_id(session: Session, context: int) -> Context | None:
    """The context with this id of ours."""
    return session.get(Context, context)


def get_context(session: Session, platform_id: int, deployment_id: str, context_id: str, title: str) -> Context:
    """The platform's course; made now, linked with no course, when it is first heard of."""
    query = select(Context).where(
        Context.platform == platform_id, Context.deployment_id == deployment_id, Context.context_id == context_id
    )
    context = session.scalar(query)
    if context is None:
        new = Context(platform=platform_id, deployment_id=deployment_id, context_id=context_id, title=title)
        context = add_once(session, new, query)
    if title and context.title != title:
        context.title = title
    return context


def list_contexts(session: Session, course: str | None = None) -> Sequence[tuple[Context, PlatformRow]]:
    """Every context, or those that are linked with a course or are asked to be; with their platforms."""
    wanted = select(Context, PlatformRow).join(PlatformRow, PlatformRow.id == Context.platform).order_by(Context.id)
    if course is not None:
        wanted = wanted.where(or_(Context.course == course, Context.wanted == course))
    return [(context, platform) for context, platform in session.execute(wanted).all()]


def resource_link(session: Session, context: int, link_id: str) -> ResourceLink:
    """The platform's link; made now when it is first heard of."""
    query = select(ResourceLink).where(ResourceLink.context == context, ResourceLink.link_id == link_id)
    link = session.scalar(query)
    return link or add_once(session, ResourceLink(context=context, link_id=link_id), query)


def enrol(session: Session, context: int, subject: str, member: str) -> None:
    """Records that a user of a context is this member."""
    query = select(LtiUser).where(LtiUser.context == context, LtiUser.subject == subject)
    user = session.scalar(query)
    if user is None:
        user = add_once(session, LtiUser(context=context, subject=subject, member=member), query)
    user.member, user.seen_at = member, now()


def find_member(session: Session, context: int, subject: str) -> str | None:
    """The id of the member who a user of a context is; None before the first launch and roster."""
    return session.scalar(select(LtiUser.member).where(LtiUser.context == context, LtiUser.subject == subject))


def place_of_review(session: Session, context: int, link_id: str, line_item_url: str) -> tuple[str | None, str | None]:
    """The quiz and question that a link of a context leads to, or else those whose scores go to this line item; None
    where neither is known."""
    links = select(ResourceLink).where(ResourceLink.context == context, ResourceLink.quiz.is_not(None))
    for same in (ResourceLink.link_id == link_id, ResourceLink.line_item_url == (line_item_url or None)):
        link = session.scalar(links.where(same).limit(1))
        if link is not None:
            return link.quiz, link.question
    containers = select(ResourceLink.line_items_url).where(ResourceLink.context == context)
    query = select(LineItem.resource).where(LineItem.url == line_item_url, LineItem.container.in_(containers))
    quiz, _, question = (session.scalar(query.limit(1)) or "").partition("/")
    return quiz or None, question or None


def find_courses(session: Session, members: Sequence[str]) -> dict[str, list[tuple[str, str]]]:
    """For members who come from platforms: the platform's name and the title of its course, of each course there."""
    rows = (
        select(LtiUser.member, PlatformRow.name, Context.title, Context.context_id)
        .join(Context, Context.id == LtiUser.context)
        .join(PlatformRow, PlatformRow.id == Context.platform)
        .where(LtiUser.member.in_(members))
        .order_by(LtiUser.member, Context.id)
    )
    courses: dict[str, list[tuple[str, str]]] = {}
    for member, name, title, context_id in session.execute(rows):
        courses.setdefault(member, []).append((name, title or context_id))
    return courses


def forget_member(session: Session, member: str) -> None:
    """Deletes what platforms told of a member."""
    session.execute(delete(LtiUser).where(LtiUser.member == member), execution_options=UNCHANGED)


def unlink(session: Session, context: Context) -> None:
    """Takes the link of a context away, with its users; answers and members stay."""
    session.execute(delete(LtiUser).where(LtiUser.context == context.id), execution_options=UNCHANGED)
    context.course = context.wanted = context.wanted_by = None


def remove(session: Session, platform: PlatformRow) -> None:
    """Deletes a platform with its contexts, links and users, and ends the sessions in its frames."""
    mine = select(Context.id).where(Context.platform == platform.id)
    for table, column in ((LtiUser, LtiUser.context), (ResourceLink, ResourceLink.context)):
        session.execute(delete(table).where(column.in_(mine)), execution_options=UNCHANGED)
    session.execute(delete(Context).where(Context.platform == platform.id), execution_options=UNCHANGED)
    session.execute(delete(Deployment).where(Deployment.platform == platform.id), execution_options=UNCHANGED)
    end = update(Credential).where(Credential.platform == platform.id, Credential.revoked_at.is_(None))
    session.execute(end.values(revoked_at=now(), platform=None), execution_options=UNCHANGED)
    session.delete(platform)


def name_column(context: int, link_id: str, line_item_url: str = "", line_items_url: str = "") -> LinkedColumn:
    """The column of a gradebook that a link of a context leads to, with the addresses that a launch told."""
    return LinkedColumn(f"{context}\n{link_id}", line_item_url or line_items_url)


def score_target(session: Session, row: Delivery) -> ScoreTarget | None:
    """Where the score of a row goes: to the column of the row's link, if the learner's own context still has the link,
    and it has a gradebook. Of several links that share a column the one counts that the learner opened first. A row of
    no link goes to the newest link of the learner's context, until the learner opens one. None if it goes nowhere."""
    wanted = (
        select(ResourceLink, Context, PlatformRow, LtiUser.subject)
        .join(Context, Context.id == ResourceLink.context)
        .join(PlatformRow, PlatformRow.id == Context.platform)
        .join(LtiUser, LtiUser.context == Context.id)
        .where(LtiUser.member == row.learner, Context.course == row.course, PlatformRow.approved_at.is_not(None))
        .where(ResourceLink.quiz == row.quiz, ResourceLink.scopes != "")
        .where(ResourceLink.question == row.question if row.question else ResourceLink.question.is_(None))
        .order_by(LtiUser.seen_at.desc(), ResourceLink.id.desc())
    )
    targets = {}
    for link, context, platform, subject in session.execute(wanted):
        column = name_column(context.id, link.link_id)
        targets[make_scores_id(row.course, row.quiz, row.question, column.link)] = ScoreTarget(
            read_platform(platform), link.line_item_url, link.line_items_url, tuple(link.scopes.split()), subject,
            context.deployment_id, link.link_id, make_resource_id(row.quiz, row.question),
        )  # fmt: skip
    unlinked = make_scores_id(row.course, row.quiz, row.question)
    others = [other for other in list_same_scores(session, row) if other.destination != unlinked]
    if row.destination == unlinked:
        return None if others else next(iter(targets.values()), None)
    target = targets.get(row.destination)
    earlier = [targets[other.destination] for other in others if other.id < row.id and other.destination in targets]
    is_told = target is not None and any(target.column == other.column for other in earlier)
    return None if is_told else target


def make_resource_id(quiz: str, question: str | None) -> str:
    """The `resourceId` of a line item: `QUIZ`, or `QUIZ/QUESTION`."""
    return f"{quiz}/{question}" if question else quiz
