"""What instructors change for a quiz: extensions for one learner, and whether the feedback is published."""

from typing import Any, Self

from fastapi import Response
from pydantic import Field, model_validator
from sqlalchemy.orm import Session

from grader.api.paging import NO_NUL, Cut, Page
from grader.api.views import ExtensionView, GivenExtension
from grader.courses.answering import publication, results
from grader.courses.people.identity import Identity
from grader.courses.people.members import find_named, require_reach
from grader.domain.policy import Extension
from grader.errors import NotFound
from grader.gate.callers import Instructor, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices
from grader.store import extensions, people
from grader.store.tables import NAME, ExtensionRow, Member

router = api_router("dates")


class ExtensionBody(Extension):
    """An extension for one learner; without dates and attempts it takes an earlier one back. The learner is named by
    `learner`, the id, or by `user`, a name that nobody else in the course has."""

    learner: str | None = Field(default=None, max_length=32, pattern=NO_NUL)
    user: str | None = Field(default=None, min_length=1, max_length=NAME, pattern=NO_NUL)

    @model_validator(mode="after")
    def _one_learner(self) -> Self:
        if (self.learner is None) == (self.user is None):
            raise ValueError("give either `learner` or `user`")
        return self


@router.get(
    "/quizzes/{quiz_id}/extensions", response_model=Page[GivenExtension], responses=refusals(401, 403, 404, 422, 429)
)
def list_extensions(quiz_id: str, who: Instructor, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the extensions in a quiz, in the order of the learners' names."""
    services.content.get(who.course).library.quiz(quiz_id)
    with services.database.read() as session:
        rows = extensions.list_of_quiz(session, who.course, quiz_id)
        return cut([describe_extension(row, name) for row, name in rows])


@router.put(
    "/quizzes/{quiz_id}/extensions", response_model=ExtensionView, responses=refusals(401, 403, 404, 413, 422, 429)
)
def put_extension(quiz_id: str, body: ExtensionBody, who: Instructor, services: AppServices) -> dict[str, Any]:
    """Gives one learner later dates, and further attempts at every question; replaces an earlier extension."""
    granted = Extension(due=body.due, until=body.until, attempts=body.attempts)
    library = services.content.get(who.course).library
    with services.database.write() as session:
        learner = find_learner(session, body, who)
        results.grant(services.database, library, session, learner, quiz_id, granted=granted, by=who)
        given = {"learner": learner.id, "user": learner.name}
    return {**given, **granted.model_dump(mode="json"), "granted_by": who.user}


def find_learner(session: Session, body: ExtensionBody, who: Identity) -> Member:
    """The learner whom the body names. Raises NotFound, Unprocessable where several have the name, and Forbidden: a
    restricted token extends students alone."""
    if body.learner is None:
        member = find_named(session, body.user or "", who.course)
    elif (found := people.get(session, body.learner, who.course)) is None:
        raise NotFound("There is no such member.")
    else:
        member = found
    require_reach(who, member.role)
    return member


@router.put("/quizzes/{quiz_id}/publication", status_code=204, responses=refusals(401, 403, 404, 422, 429))
def publish_feedback(quiz_id: str, who: Instructor, services: AppServices) -> Response:
    """Publishes the feedback of a quiz with `"feedback": "after_publish"`: learners see how they were graded."""
    services.content.get(who.course).library.quiz(quiz_id)
    with services.database.write() as session:
        publication.publish(services.database, session, who, quiz_id)
    return Response(status_code=204)


@router.delete("/quizzes/{quiz_id}/publication", status_code=204, responses=refusals(401, 403, 404, 422, 429))
def withhold_feedback(quiz_id: str, who: Instructor, services: AppServices) -> Response:
    """Withholds the feedback of a quiz again."""
    services.content.get(who.course).library.quiz(quiz_id)
    with services.database.write() as session:
        publication.withdraw(session, who, quiz_id)
    return Response(status_code=204)


@router.post("/quizzes/{quiz_id}/results:recount", responses=refusals(401, 403, 404, 422, 429))
def recount_results(quiz_id: str, who: Instructor, services: AppServices) -> dict[str, int]:
    """Counts every result of a quiz again, after its policy has changed; the feed gets those that change."""
    library = services.content.get(who.course).library
    library.quiz(quiz_id)
    return {"recounted": results.recount_quiz(services.database, library, who.course, quiz_id)}


def describe_extension(row: ExtensionRow, user: str) -> dict[str, Any]:
    """An extension as plain JSON; `user` is the learner's name."""
    names = ("learner", "due", "until", "attempts", "granted_by", "created_at")
    return {"user": user} | {name: getattr(row, name) for name in names}
