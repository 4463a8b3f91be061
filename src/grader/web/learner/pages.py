"""What a learner sees: the lessons, a lesson, an exercise, two attempts side by side, and plots to take along."""

from functools import cache
from pathlib import Path
from typing import Annotated

from fastapi import Query, Request
from fastapi.responses import PlainTextResponse, RedirectResponse, Response

from grader.courses.people.identity import DEFAULT_COURSE, Identity, Role
from grader.domain.pages.markup import plain_text
from grader.errors import NotFound, Unauthorized
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.library import Library
from grader.library.lesson_ids import OTHER, find_lesson_id
from grader.pack.kit import build_kit
from grader.questions import kind_of
from grader.queue import jobs
from grader.store.events import case_now
from grader.store.submissions import QUEUED, RUNNING
from grader.web.frame.assets import FOLDER
from grader.web.frame.inputs import Visitor
from grader.web.frame.rendering import HEADERS, page
from grader.web.learner.exercise import align_scripts, build_exercise_page
from grader.web.learner.lesson import TypedAnswer, build_lesson_page, list_opened_facts
from grader.web.text.lessons import Lesson, group_lessons
from grader.web.text.questions import list_titles, present_question
from grader.web.verdict.plots import draw_file, extract_light_styles, list_sketches
from grader.web.verdict.reel import REEL_MAX, build_reel
from grader.web.verdict.work import list_attempts, read_work

SIGN_IN = "Sign in first."
NO_ATTEMPT = "You have no such attempt."

router = page_router()


def show_sign_in(request: Request, services: Services, who: Identity | None) -> Response:
    """Says how to sign in, for a browser that has to: 401, or 403 in the wrong role."""
    return page(request, "signin.html", 401 if who is None else 403, who=who, oidc=services.provider is not None)


def find_reader(who: Identity | None) -> Identity:
    """Returns the learner of a page; for a browser on loopback whose session has not begun, one without any work."""
    return who or Identity("", "", Role.STUDENT, DEFAULT_COURSE)


@router.get("/")
def home(request: Request, services: AppServices, who: Visitor, quiz: str | None = None) -> Response:
    """The lesson, or the list of lessons where there are several; with `?quiz=` that quiz alone. On loopback anyone may
    read; the first answer begins a session."""
    if who is None and not services.sessions.anonymous:
        return show_sign_in(request, services, who)
    if quiz is not None:
        return show_lesson(request, services, who, f"/?quiz={quiz}")
    lessons = group_lessons(services.library_for(who))
    if len(lessons) == 1:
        return show_lesson(request, services, who, "/")
    return show_lessons(request, services, who, lessons)


def show_lessons(request: Request, services: Services, who: Identity | None, lessons: list[Lesson]) -> Response:
    """Renders the list of lessons with the learner's points."""
    library, reader = services.library_for(who), find_reader(who)
    quizzes = [quiz for lesson in lessons for quiz in lesson.quizzes]
    with services.database.read() as session:
        work = read_work(session, library, reader, quizzes, services.answers_in(library))
    rows = [
        {
            "lesson": lesson,
            "names": [plain_text(quiz.title) for quiz in lesson.quizzes],
            "facts": list_opened_facts(lesson.quizzes, work),
        }
        for lesson in lessons
    ]
    return page(request, "lessons.html", who=who, rows=rows)


@router.get("/lessons/{lesson}")
def lesson_by_id(lesson: str, request: Request, services: AppServices, who: Visitor) -> Response:
    """One lesson. Raises NotFound."""
    if who is None and not services.sessions.anonymous:
        return show_sign_in(request, services, who)
    return show_lesson(request, services, who, f"/lessons/{lesson}")


def show_lesson(
    request: Request, services: Services, who: Identity | None, address: str, *,
    typed: TypedAnswer | None = None, status: int = 200,
) -> Response:  # fmt: skip
    """Renders the lesson at an address: `/`, `/lessons/...` or `/?quiz=...`. Raises NotFound."""
    library, reader = services.library_for(who), find_reader(who)
    lesson = find_lesson(library, address)
    with services.database.read() as session:
        work = read_work(session, library, reader, lesson.quizzes, services.answers_in(library))
    shown = build_lesson_page(library, lesson, work, typed)
    shown["is_one_of_several"] = len(group_lessons(library)) > 1
    return page(request, "lesson.html", status, who=who, address=address, **shown)


def find_lesson(library: Library, address: str) -> Lesson:
    """Returns the lesson that an address shows. Raises NotFound."""
    kind, _, name = address.strip("/").replace("?quiz=", "quiz/").partition("/")
    if kind == "quiz":
        quiz = library.quiz(name)
        return Lesson(quiz.id, plain_text(quiz.title), (quiz,))
    lessons = [lesson for lesson in group_lessons(library) if kind == "" or lesson.id == name]
    if kind == "" and len(lessons) != 1:
        return Lesson(OTHER, "Questions and exercises", tuple(library.quizzes.values()))
    if not lessons:
        raise NotFound(f"There is no lesson {name!r}.")
    return lessons[0]


@router.get("/quizzes/{quiz_id}/{question_id}")
def exercise(
    quiz_id: str, question_id: str, *, request: Request, services: AppServices, who: Visitor, attempt: str | None = None
) -> Response:
    """An exercise with its newest verdict, or an earlier attempt; any other question stands on its lesson's page.
    Raises NotFound, and Conflict before the quiz opens."""
    if who is None and not services.sessions.anonymous:
        return show_sign_in(request, services, who)
    library = services.library_for(who)
    question = library.question(quiz_id, question_id)
    services.require_opened(library, find_reader(who), quiz_id)
    if not kind_of(question).is_script:
        return RedirectResponse(f"/lessons/{find_lesson_id(quiz_id)}#{quiz_id}--{question_id}", 303)
    return show_exercise(request, services, who, quiz_id=quiz_id, question_id=question_id, attempt=attempt)


def show_exercise(
    request: Request, services: Services, who: Identity | None, *, quiz_id: str, question_id: str,
    attempt: str | None = None, typed: TypedAnswer | None = None, status: int = 200,
) -> Response:  # fmt: skip
    """Renders the page of an exercise. Raises NotFound."""
    library, reader = services.library_for(who), find_reader(who)
    quiz = library.quiz(quiz_id)
    with services.database.read() as session:
        work = read_work(session, library, reader, [quiz], services.answers_in(library))
        attempts = list_attempts(session, work, reader, quiz_id, question_id, also=[attempt])
        state, newest = (attempts[0].state, attempts[0].id) if attempts else ("", "")
        ahead = jobs.count_ahead(session, newest, reader.id) if state == QUEUED else None
        at = case_now(session, newest) if state == RUNNING else None
    shown = build_exercise_page(library, quiz, question_id, work, attempts, chosen=attempt, typed=typed)
    shown |= {"ahead": ahead, "at": at, "refused": status != 200}
    return page(request, "exercise.html", status, who=who, **shown)


@router.get("/quizzes/{quiz_id}/{question_id}/attempts")
def compare(
    quiz_id: str, question_id: str, *, request: Request, services: AppServices, who: Visitor,
    left: Annotated[str | None, Query(max_length=64)] = None, right: Annotated[str | None, Query(max_length=64)] = None,
) -> Response:  # fmt: skip
    """Two attempts side by side, the two newest without a choice. Raises Unauthorized, NotFound."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    library = services.library_for(who)
    quiz, question = library.find(quiz_id, question_id)
    with services.database.read() as session:
        work = read_work(session, library, who, [quiz], services.answers_in(library))
        attempts = list_attempts(session, work, who, quiz_id, question_id, also=[left, right])
    if len(attempts) < 2:
        raise NotFound("There are no two attempts to compare yet.")
    by_id = {attempt.id: attempt for attempt in attempts}
    pair = (left or attempts[1].id, right or attempts[0].id)
    if not by_id.keys() >= {*pair}:
        raise NotFound(NO_ATTEMPT)
    chosen = [by_id[id_] for id_ in pair]
    view, lines = present_question(library, quiz_id, question), align_scripts(chosen[0].text, chosen[1].text)
    return page(request, "compare.html", who=who, view=view, attempts=attempts, chosen=chosen, lines=lines)


@router.get("/quizzes/{quiz_id}/{question_id}/reel")
def reel(
    quiz_id: str, question_id: str, *, request: Request, services: AppServices, who: Visitor,
    attempt: Annotated[str | None, Query(max_length=64)] = None,
) -> Response:  # fmt: skip
    """The learner's attempts at a question one after the other. Raises Unauthorized, NotFound."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    library = services.library_for(who)
    question = library.question(quiz_id, question_id)
    with services.database.read() as session:
        work = read_work(session, library, who, [library.quiz(quiz_id)], services.answers_in(library))
        attempts = list_attempts(session, work, who, quiz_id, question_id, most=REEL_MAX)
    whole = [given for given in attempts if given.is_whole]
    title, base = list_titles(library)[quiz_id, question_id], f"/quizzes/{quiz_id}/{question_id}"
    return page(
        request, "reel.html", who=who, layout="base.html", title=title, up=(base, f"Back to {title}"),
        base=f"{base}/reel", pictures=f"{base}/attempts", reel=build_reel(whole, question, attempt),
    )  # fmt: skip


@router.get("/quizzes/{quiz_id}/{question_id}/starter.xml")
@router.get("/quizzes/{quiz_id}/{question_id}/starter.py")
def starter(request: Request, quiz_id: str, question_id: str, services: AppServices, who: Visitor) -> Response:
    """The starter file of an exercise. Raises Unauthorized, NotFound, and Conflict before the quiz opens."""
    if who is None and not services.sessions.anonymous:
        raise Unauthorized(SIGN_IN)
    library = services.library_for(who)
    services.require_opened(library, find_reader(who), quiz_id)
    question = library.question(quiz_id, question_id)
    suffix = Path(request.url.path).suffix
    text, named = library.starter(question), kind_of(question).starter(question) or ""
    if text is None or Path(named).suffix != suffix:
        raise NotFound("This question has no starter file.")
    name = question_id.replace("-", "_")
    headers = {"Content-Disposition": f'attachment; filename="{name}{suffix}"'}
    return PlainTextResponse(text, headers=HEADERS | headers)


@router.get("/quizzes/{quiz_id}/{question_id}/kit.zip")
def kit(quiz_id: str, question_id: str, *, request: Request, services: AppServices, who: Visitor) -> Response:
    """The kit of an exercise. Raises Unauthorized, NotFound, and Conflict before the quiz opens."""
    if who is None and not services.sessions.anonymous:
        raise Unauthorized(SIGN_IN)
    library = services.library_for(who)
    policy = services.require_opened(library, find_reader(who), quiz_id)
    headers = {"Content-Disposition": f'attachment; filename="{question_id}.zip"'}
    packed = build_kit(
        library, quiz_id, question_id, judged=policy.shows_feedback_at_once, origin=services.origin_of(request)
    )
    return Response(packed, headers=HEADERS | headers, media_type="application/zip")


@router.get("/quizzes/{quiz_id}/{question_id}/attempts/{attempt}/{name}.svg")
def plot(quiz_id: str, question_id: str, attempt: str, name: str, *, services: AppServices, who: Visitor) -> Response:
    """One plot of the learner's own verdict as a file. Raises Unauthorized, NotFound."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    library = services.library_for(who)
    with services.database.read() as session:
        work = read_work(session, library, who, [library.quiz(quiz_id)], services.answers_in(library))
        attempts = list_attempts(session, work, who, quiz_id, question_id, also=[attempt])
    given = next(
        (candidate for candidate in attempts if candidate.id == attempt and candidate.verdict is not None), None
    )
    if given is None or given.verdict is None:
        raise NotFound(NO_ATTEMPT)
    titles = {finding["id"]: finding["title"] for finding in given.verdict.get("findings") or []}
    picture = next(
        (sketch for sketch in list_sketches(given.verdict.get("evidence") or {}, titles) if sketch.name == name), None
    )
    if picture is None:
        raise NotFound("This verdict has no such plot.")
    headers = {"Content-Disposition": f'attachment; filename="{question_id}-{name}.svg"'}
    policy = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; sandbox"}
    return Response(
        draw_file(picture, read_plot_styles()), headers=HEADERS | headers | policy, media_type="image/svg+xml"
    )


@cache
def read_plot_styles() -> str:
    """Returns the style sheet's rules for plots."""
    return extract_light_styles((FOLDER / "style.css").read_text(encoding="utf-8"))
