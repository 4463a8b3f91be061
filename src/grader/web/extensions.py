"""`/instructor/extensions`: later dates and further attempts for one learner, and the feedback of a quiz. No script."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import RedirectResponse, Response
from pydantic import ValidationError

from grader.courses import publication, results
from grader.domain.policy import Extension
from grader.errors import NotFound, Unprocessable
from grader.identity import Identity, Role
from grader.store import extensions, people
from grader.web.context import Form, PageContext, Pages, Visitor, instructor
from grader.web.lesson_page import day
from grader.web.rendering import page
from grader.web.student_pages import sign_in_page

PAGE = "/instructor/extensions"
MOMENT = "%Y-%m-%dT%H:%M"

router = APIRouter(include_in_schema=False)


@router.get(PAGE)
def show(request: Request, pages: Pages, who: Visitor, quiz: Annotated[str, Query(max_length=64)] = "") -> Response:
    """The dates of a quiz, and its extensions; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return sign_in_page(request, pages, who)
    return shown(request, pages, who, quiz)


def shown(request: Request, pages: PageContext, who: Identity, quiz: str, status: int = 200, **more: Any) -> Response:
    """The page of a quiz, of the first one without a choice, with the outcome of a form."""
    library = pages.library_for(who)
    quizzes = [one for one in library.quizzes.values() if one.questions]
    if not quizzes:
        return page(request, "extensions.html", who=who, quizzes=[])
    chosen = library.quiz(quiz) if quiz else quizzes[0]
    with pages.database.read() as session:
        members = people.everybody(session, who.course)
        given = [
            {"name": name, "row": row, "due": row.due and day(row.due), "until": row.until and day(row.until)}
            for row, name in extensions.of_quiz(session, who.course, chosen.id)
        ]
        published = extensions.published(session, who.course, [chosen.id]).get(chosen.id)
    context: dict[str, Any] = {
        "learners": [one for one in members if one.removed_at is None and one.role == Role.STUDENT],
        "quizzes": quizzes,
        "quiz": chosen,
        "dates": dates_of(chosen.policy),
        "given": given,
        "published": published and day(published),
        "typed": {},
    }
    return page(request, "extensions.html", status, who=who, **(context | more))


def dates_of(policy: Any) -> dict[str, str]:
    """What the policy of a quiz says of dates and attempts, in words."""
    moments = {"opens": policy.opens, "due": policy.due, "late until": policy.late and policy.late.until}
    dates = {name: day(moment) for name, moment in moments.items() if moment is not None}
    return dates | {"attempts": "any number" if policy.attempts is None else str(policy.attempts)}


@router.post(PAGE)
def grant(request: Request, pages: Pages, who: Visitor, form: Form) -> Response:
    """Gives an extension, or takes it back where nothing is given. Shows the page again if it is refused."""
    who, quiz = instructor(who), form.get("quiz", "")
    try:
        granted = granted_by(form)
        with pages.database.write() as session:
            learner = people.get(session, form.get("learner", ""), who.course)
            if learner is None:
                raise NotFound("There is no such learner.")
            library = pages.library_for(who)
            results.grant(pages.database, library, session, learner, quiz, granted=granted, by=who)
    except Unprocessable as error:
        return shown(request, pages, who, quiz, 422, trouble=str(error), typed=form)
    return RedirectResponse(f"{PAGE}?quiz={pages.library_for(who).quiz(quiz).id}", 303)


def granted_by(form: dict[str, str]) -> Extension:
    """The extension that a form asks for; its moments are in UTC. Raises Unprocessable."""
    moments = {name: f"{form[name]}Z" for name in ("due", "until") if form.get(name)}
    try:
        attempts = int(form.get("attempts") or 0)
        return Extension.model_validate({**moments, "attempts": attempts})
    except ValidationError as error:
        named = ", ".join(sorted({str(one["loc"][0]) for one in error.errors() if one["loc"]}))
        raise Unprocessable(f"Check {named}: dates lie in 2000 to 2199, and further attempts are 0 to 1000.") from error
    except ValueError as error:
        raise Unprocessable("Check attempts: a whole number of 0 to 1000.") from error


@router.post(f"{PAGE}/publication")
def publish(pages: Pages, who: Visitor, form: Form) -> Response:
    """Publishes the feedback of a quiz, or withholds it again. Raises Unauthorized, Forbidden, NotFound."""
    who = instructor(who)
    quiz = pages.library_for(who).quiz(form.get("quiz", ""))
    with pages.database.write() as session:
        if "withhold" in form:
            publication.withdraw(session, who, quiz.id)
        else:
            publication.publish(pages.database, session, who, quiz.id)
    return RedirectResponse(f"{PAGE}?quiz={quiz.id}", 303)
