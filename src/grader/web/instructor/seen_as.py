"""`/instructor/learners/{id}/lessons/...`: a lesson or an exercise as one learner sees it now. Nothing can be sent. The
policy decides for the learner, not for the instructor who looks. Answers that are under review without a name are left
out. Every look is written into the audit log."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fastapi import Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity, Role
from grader.courses.people.namesakes import make_marks, mark_name
from grader.courses.reviewing.blinding import find_unseen, hide_names
from grader.errors import NotFound
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.library.lesson_ids import find_lesson_id
from grader.questions import Quiz, kind_of
from grader.store import people, submissions
from grader.web.frame.inputs import Instructor
from grader.web.frame.rendering import POLICY, page, security_policy
from grader.web.learner.exercise import build_exercise_page
from grader.web.learner.lesson import build_lesson_page
from grader.web.learner.pages import find_lesson
from grader.web.verdict.work import Work, list_attempts, read_work

UNDER_REVIEW = "An answer here is under review without a name, and left out."
READ_ONLY = {POLICY: security_policy().replace("form-action 'self'", "form-action 'none'")}
"""Lets the browser send no form of the page."""

router = page_router()


@router.get("/instructor/learners/{learner}/lessons/{lesson}")
def lesson_as(learner: str, lesson: str, request: Request, services: AppServices, who: Instructor) -> Response:
    """A lesson as a learner sees it. Raises Unauthorized, Forbidden, NotFound."""
    desk = services.desk_of(who.course)
    loaded = find_lesson(services.library_for(Identity(learner, "", Role.STUDENT, who.course)), f"/lessons/{lesson}")
    with services.database.write() as session:
        reader = get_learner(session, who, learner)
        work = read_visible_work(session, services, who, reader, loaded.quizzes)
        record(session, who, who.course, Action.SEEN_AS, reader.id, lesson=lesson)
    shown = build_lesson_page(desk.library, loaded, work)
    for question in (view for quiz in shown["quizzes"] for view in quiz["questions"]):
        question.view["path"] = f"{make_path(learner)}{question.view['path']}"
    return render(request, "lesson.html", who, reader, shown | {"address": request.url.path})


@router.get("/instructor/learners/{learner}/quizzes/{quiz_id}/{question_id}")
def exercise_as(
    learner: str, quiz_id: str, question_id: str, *, request: Request, services: AppServices, who: Instructor,
    attempt: str | None = None,
) -> Response:  # fmt: skip
    """An exercise as a learner sees it; any other question is part of its lesson. Raises Unauthorized, Forbidden,
    NotFound, and Conflict before the quiz opens."""
    desk = services.desk_of(who.course)
    question, quiz = desk.library.question(quiz_id, question_id), desk.library.quiz(quiz_id)
    services.require_opened(desk.library, Identity(learner, "", Role.STUDENT, who.course), quiz_id)
    if not kind_of(question).is_script:
        return RedirectResponse(f"{make_path(learner)}/lessons/{find_lesson_id(quiz_id)}#{quiz_id}--{question_id}", 303)
    with services.database.write() as session:
        reader = get_learner(session, who, learner)
        work = read_visible_work(session, services, who, reader, [quiz])
        attempts = list_attempts(session, work, reader, quiz_id, question_id, also=[attempt])
        names = hide_names(
            desk, session, who, submissions.get_several(session, [attempt.id for attempt in attempts]), {}
        ).names
        record(session, who, who.course, Action.SEEN_AS, reader.id, quiz=quiz_id, question=question_id)
    visible = [attempt for attempt in attempts if attempt.id not in names]
    shown = build_exercise_page(desk.library, quiz, question_id, work, visible, chosen=attempt)
    shown["here"].view["path"] = f"{make_path(learner)}{shown['here'].view['path']}"
    shown["lesson"]["path"] = f"{make_path(learner)}{shown['lesson']['path']}"
    return render(request, "exercise.html", who, reader, shown)


def make_path(learner: str) -> str:
    """Says what every address of a learner's view begins with."""
    return f"/instructor/learners/{learner}"


def get_learner(session: Session, who: Identity, learner: str) -> Identity:
    """Returns a member of the instructor's course, as a student, with the mark of the name. Raises NotFound."""
    member = people.get(session, learner, who.course)
    if member is None:
        raise NotFound("There is no such learner.")
    name = mark_name(member.name, member.id, make_marks(session, member.course))
    return Identity(member.id, name, Role.STUDENT, member.course)


def render(request: Request, template: str, who: Identity, reader: Identity, shown: dict[str, Any]) -> Response:
    """Renders a learner's page, with a banner and without forms that can be sent."""
    return page(request, template, 200, READ_ONLY, who=who, seen_as=reader, **shown)


def read_visible_work(
    session: Session, services: Services, who: Identity, reader: Identity, quizzes: Sequence[Quiz]
) -> Work:
    """A learner's work, without answers and marks that the instructor is kept from seeing under the learner's name."""
    desk = services.desk_of(who.course)
    work = read_work(session, desk.library, reader, quizzes, services.answers_in(desk.library))
    newest = submissions.find_newest(session, reader.course, reader.id)
    earlier = [comment.submission for place in work.places.values() for comment in place.commented]
    rows = [*newest, *submissions.get_several(session, earlier)] if earlier else newest
    names = hide_names(desk, session, who, rows, {}).names
    hidden = {(row.quiz, row.question) for row in newest if row.id in names}
    hidden |= {
        (result.quiz, result.question) for result in find_unseen(session, who).results if result.learner == reader.id
    }
    places = {}
    for at, place in work.places.items():
        seen = replace(place, commented=[comment for comment in place.commented if comment.submission not in names])
        places[at] = replace(seen, given=None, points=None, notice=UNDER_REVIEW) if at in hidden else seen
    return replace(work, places=places)
