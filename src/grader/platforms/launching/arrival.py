"""Where a verified launch arrives: its deployment, its course, its link and the member are found, or made."""

from dataclasses import dataclass

from sqlalchemy.orm import Session

from grader.courses.people import members
from grader.courses.people import platforms as rules
from grader.courses.people.identity import Role
from grader.courses.people.platforms import Person
from grader.courses.sending.outbox import send_scores
from grader.errors import Forbidden, NotFound
from grader.platforms.launching import claims as words
from grader.platforms.launching.launch import Gradebook, Launch
from grader.store import platforms
from grader.store.engine.database import Database
from grader.store.platforms import Context, ResourceLink
from grader.store.tables import Member

NOT_APPROVED = (
    "This installation of the tool (deployment {}) waits for approval: ask the administrator of the grader for "
    "`grader lti approve`, or to approve it on the page /instructor/lti."
)


@dataclass(frozen=True)
class Arrival:
    """What a launch leads to. `member` is None while the platform's course is linked with no course here."""

    context: Context
    member: Member | None
    role: Role
    quiz: str | None
    question: str | None


def arrive(database: Database, session: Session, launch: Launch) -> Arrival | None:
    """Records what the launch tells, and finds who comes and where to. Raises Forbidden for a removed member. A
    learner's scores go to the link's column from now on, where the launch grants that. None if the launch's deployment
    is not approved; one that is new is noted, to be approved."""
    deployment = platforms.note_deployment(session, launch.platform.id, launch.deployment_id)
    if deployment is None or deployment.approved_at is None:
        return None
    context = platforms.get_context(
        session, launch.platform.id, launch.deployment_id, launch.context_id, launch.context_title
    )
    if launch.members_url and context.members_url != launch.members_url:
        context.members_url = launch.members_url
    session.flush()
    quiz, question = find_place(session, context, launch)
    role = Role.INSTRUCTOR if launch.teaches and launch.subject is not None else Role.STUDENT
    if context.course is None:
        return Arrival(context, None, role, quiz, question)
    if launch.subject is None:
        member = members.make_unnamed(session, context.course)
    else:
        person = Person(launch.platform.issuer, launch.subject, launch.name, role)
        member = rules.get_member(session, context, person)
        sends = launch.reviewed is None and words.SCORES in launch.gradebook.scopes
        if sends and quiz is not None and role is Role.STUDENT:
            book = launch.gradebook
            column = platforms.name_column(context.id, launch.link_id, book.line_item_url, book.line_items_url)
            place = (context.course, quiz, question or "")
            send_scores(database, session, *place, learner=member.id, by="lti", column=column)
    return Arrival(context, member, role, quiz, question)


def find_place(session: Session, context: Context, launch: Launch) -> tuple[str | None, str | None]:
    """Returns the quiz and question that a launch leads to; its link is recorded. A Submission Review says less of its
    link than a launch by it, and changes none; where it names no quiz, its column of the gradebook does."""
    if launch.reviewed is None:
        link = record_launch(session, context, launch) if launch.link_id else None
        return (None, None) if link is None else (link.quiz, link.question)
    if launch.quiz is not None:
        return launch.quiz, launch.question
    return platforms.place_of_review(session, context.id, launch.link_id, launch.gradebook.line_item_url)


def find_reviewed(session: Session, launch: Launch, arrival: Arrival) -> str:
    """Returns the member whose work a Submission Review opens: anybody's for an instructor, else one's own. Raises
    Forbidden, NotFound."""
    assert launch.reviewed is not None
    if arrival.role is not Role.INSTRUCTOR and launch.reviewed != launch.subject:
        raise Forbidden("Only an instructor of the course looks at the work of others.")
    member = platforms.find_member(session, arrival.context.id, launch.reviewed)
    if member is None:
        raise NotFound("This learner has not been here by a link of this course: there is no work to show.")
    return member


def record_launch(session: Session, context: Context, launch: Launch) -> ResourceLink:
    """Returns the launch's link, with what the launch tells of it: what it leads to, and its place in the gradebook. A
    launch that does not grant scores, such as that of a teacher, takes no place away from learners whose scores are on
    their way: what the platform no longer takes, it refuses itself."""
    link = platforms.resource_link(session, context.id, launch.link_id)
    is_elsewhere = (link.quiz, link.question) != (launch.quiz, launch.question)
    if is_elsewhere:
        link.quiz, link.question = launch.quiz, launch.question
    known = Gradebook(link.line_item_url, link.line_items_url, tuple(link.scopes.split()))
    takes_away = words.SCORES in known.scopes and words.SCORES not in launch.gradebook.scopes
    if launch.gradebook != known and (is_elsewhere or not takes_away):
        link.line_item_url, link.line_items_url = launch.gradebook.line_item_url, launch.gradebook.line_items_url
        link.scopes = " ".join(launch.gradebook.scopes)
    return link
