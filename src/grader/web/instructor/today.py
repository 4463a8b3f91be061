"""What an instructor sees: what needs a person today, who is stuck, the content and its answer keys."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.answering.policies import read_policies
from grader.courses.people.identity import DEFAULT_COURSE, CredentialKind, Identity
from grader.courses.people.namesakes import make_marks, mark_name
from grader.courses.reporting.stuck import (
    SUBMISSIONS_MAX,
    SharedMistake,
    StuckLearner,
    find_shared_mistakes,
    find_stuck,
)
from grader.courses.reporting.today import COUNTED_MAX, Today, read_today
from grader.domain.verdict import Status
from grader.errors import ContentError
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.library import Library
from grader.platforms import administration
from grader.queue import jobs
from grader.store import credentials, people, results, submissions
from grader.store.reviewing.reviews import WaitingQuestion
from grader.store.tables import now
from grader.web.frame.inputs import Instructor, Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.certificates import list_certificates
from grader.web.instructor.reviewing.review_list import DIFFER, FIRST, SECOND, Chosen
from grader.web.instructor.reviewing.review_list import PAGE as REVIEW
from grader.web.learner.pages import show_sign_in
from grader.web.text.numbers import write_span
from grader.web.text.questions import describe_quiz, list_titles

PAGE = "/instructor"
STUCK = f"{PAGE}/stuck"
STUCK_SHOWN = 5
"""Learners who are stuck that the first page names."""

DAY = timedelta(days=1)

router = page_router()


@dataclass(frozen=True)
class TaskLine:
    """What waits: its title with a link, and what more is to be known."""

    title: str
    more: str
    address: str


@dataclass(frozen=True)
class Task:
    """One kind of things that need a person."""

    count: str
    title: str
    lines: tuple[TaskLine, ...]
    address: str
    verb: str


@router.get(PAGE)
@router.get(f"{PAGE}/")
def home(request: Request, services: AppServices, who: Visitor) -> Response:
    """What needs a person today, and how far the queue is; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    library = services.library_for(who)
    with services.database.read() as session:
        today = read_today(services.desk_of(who.course), session, who)
        requests, stuck = list_requests(session, who), find_stuck_learners(session, who)
        marks = make_marks(session, who.course) if stuck else {}
        alive, scripts = services.monitor.workers_alive(session), jobs.read_state(session)[jobs.GRADE]
        state = describe_course(session, library, who.course)
        shared = find_shared_mistakes(session, who.course)
    tasks = [*list_tasks(library, today), *list_stuck(library, stuck, marks), *list_platform_tasks(requests)]
    refused = services.content.get(who.course).refused
    shown: dict[str, Any] = {"today": today, "alive": alive, "scripts": scripts, "faults": library.warnings}
    return page(
        request, "today.html", who=who, tasks=tasks, refused=refused, shared=list_shared(library, shared),
        most=max((mistake.learners for mistake in shared), default=1),
        tier=services.monitor.graders.jail.get("tier"), **state, **shown,
    )  # fmt: skip


def describe_course(session: Session, library: Library, course: str) -> dict[str, Any]:
    """Returns what the page says of the class, of the last day and of the content."""
    clock, quizzes = now(), library.quizzes
    policies = read_policies(session, library, course, quizzes)
    due = min(
        ((policy.due, quiz) for quiz, policy in policies.items() if policy.due and policy.due > clock), default=None
    )
    outcomes = submissions.count_outcomes(session, course, clock - DAY, SUBMISSIONS_MAX)
    graded = sum(outcomes.values())
    return {
        "learners": people.count_learners(session, [course]).get(course, 0),
        "taking_part": results.count_taking_part(session, course, list(quizzes) if due is None else [due[1]]),
        "due": due,
        "graded": graded,
        "more_graded": graded >= SUBMISSIONS_MAX,
        "our_faults": outcomes.get(Status.GRADER_FAULT, 0),
        "quizzes": len(quizzes),
        "questions": sum(len(quiz.questions) for quiz in quizzes.values()),
        "labs": sum(len(quiz.labs) for quiz in quizzes.values()),
        "invited": len(credentials.list_alive(session, course, CredentialKind.SIGN_IN, clock)),
    }


def list_shared(library: Library, shared: Sequence[SharedMistake]) -> list[dict[str, Any]]:
    """Returns the mistakes that several learners still make, as the page shows them."""
    titles = list_titles(library)
    return [
        {
            "name": mistake.name,
            "title": titles.get((mistake.quiz, mistake.question), mistake.question),
            "learners": mistake.learners,
            "address": f"{PAGE}/class/{mistake.quiz}/{mistake.question}#m-{mistake.key}",
        }
        for mistake in shared
    ]


def list_tasks(library: Library, today: Today) -> list[Task]:
    """Returns the reviews that wait, as the page shows them."""
    kinds = (
        (FIRST, today.first, "wait for a review", "Review"),
        (SECOND, today.second, "wait for your second mark", "Mark"),
        (DIFFER, today.differing, "have two marks that differ", "Decide"),
    )
    titles = list_titles(library)
    return [make_task(titles, which, waiting, words, verb) for which, waiting, words, verb in kinds if waiting]


def make_task(
    titles: Mapping[tuple[str, str], str], which: str, waiting: Sequence[WaitingQuestion], words: str, verb: str
) -> Task:
    """Returns one kind of reviews, by question."""
    total, address = sum(queue.answers for queue in waiting), f"{REVIEW}?{Chosen(which).query}"
    lines = tuple(
        TaskLine(
            describe_place(titles, queue),
            f"{queue.answers}, the oldest for {describe_age(queue.since)}",
            f"{REVIEW}?{Chosen(which, queue.quiz, queue.question).query}",
        )
        for queue in waiting
    )
    if total == 1:
        words = words.replace("wait ", "waits ").replace("have ", "has ")
    count = f"{total}+" if total >= COUNTED_MAX else str(total)
    return Task(count, f"answer{'' if total == 1 else 's'} {words}", lines, address, verb)


def find_stuck_learners(session: Session, who: Identity) -> list[StuckLearner]:
    """Returns the learners of the instructor's course who are stuck."""
    return find_stuck(session, who.course, results.list_instructors(session, who.course))


def list_stuck(library: Library, stuck: Sequence[StuckLearner], marks: Mapping[str, str]) -> Iterable[Task]:
    """Yields the learners who are stuck, if any are; the first ones by name."""
    if stuck:
        titles = list_titles(library)
        lines = tuple(
            TaskLine(
                mark_name(learner.name, learner.learner, marks),
                f"{describe_place(titles, learner)}, {learner.attempts} attempts: {learner.diagnosis}",
                make_address(learner),
            )
            for learner in stuck[:STUCK_SHOWN]
        )
        number = len({learner.learner for learner in stuck})
        yield Task(str(number), "learner is stuck" if number == 1 else "learners are stuck", lines, STUCK, "Show")


def describe_place(titles: Mapping[tuple[str, str], str], item: StuckLearner | WaitingQuestion) -> str:
    """Names the quiz, and the question by its title."""
    return f"{item.quiz}: {titles.get((item.quiz, item.question), item.question)}"


def make_address(learner: StuckLearner) -> str:
    """Returns the address of what a learner has answered to the question."""
    return f"{PAGE}/learners/{learner.learner}#{learner.quiz}--{learner.question}"


def describe_age(moment: datetime) -> str:
    """Says how long ago a moment was."""
    return write_span((now() - moment).total_seconds())


@router.get(STUCK)
def stuck(request: Request, services: AppServices, who: Visitor) -> Response:
    """Learners who make the same mistake again and again; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    titles = list_titles(services.library_for(who))
    with services.database.read() as session:
        learners, marks = find_stuck_learners(session, who), make_marks(session, who.course)
    rows = [
        {
            "one": learner,
            "title": describe_place(titles, learner),
            "story": make_address(learner),
            "ago": describe_age(learner.last),
        }
        for learner in learners
    ]
    return page(request, "stuck.html", who=who, rows=rows, marks=marks)


def list_requests(session: Session, who: Identity) -> list[str]:
    """Says what learning platforms wait for: links to this course, and for administrators their approval."""
    contexts = administration.list_contexts(session, who.course)
    requests = [f"{context['title']} asks for a link" for context in contexts if not context["course"]]
    platforms = administration.list_platforms(session) if who.course == DEFAULT_COURSE else []
    pending = [
        platform for platform in platforms if not all(each["approved"] for each in (platform, *platform["deployments"]))
    ]
    return requests + [f"{platform['name']} waits for approval" for platform in pending]


def list_platform_tasks(requests: Sequence[str]) -> Iterable[Task]:
    """Yields the platforms that wait, if any do."""
    if requests:
        lines = tuple(TaskLine(text, "", "/instructor/lti") for text in requests)
        title = "request of a learning platform" if len(requests) == 1 else "requests of learning platforms"
        yield Task(str(len(requests)), title, lines, "/instructor/lti", "Open")


@router.get(f"{PAGE}/content")
def content(
    request: Request, services: AppServices, who: Visitor, *, loaded: str = "",
    regrade: Annotated[str, Query(max_length=20_000)] = "",
) -> Response:  # fmt: skip
    """The quizzes that are loaded, what was remarked on them, and why the last change was refused, if it was. To anyone
    but an instructor, how to sign in. `loaded` follows a change that was taken, `regrade` names the questions
    (`quiz/question,...`) whose verdicts are of before."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    library, refused = services.library_for(who), services.content.get(who.course).refused
    quizzes = [describe_quiz(library, quiz) | {"digest": library.digest(quiz.id)} for quiz in library.quizzes.values()]
    titles, chosen = list_titles(library), regrade.split(",")
    to_regrade = [(f"{at[0]}/{at[1]}", title) for at, title in titles.items() if f"{at[0]}/{at[1]}" in chosen]
    return page(
        request, "content.html", who=who, quizzes=quizzes, remarks=library.warnings, refused=refused, loaded=loaded,
        to_regrade=to_regrade,
    )  # fmt: skip


@router.post(f"{PAGE}/content")
def reload_content(services: AppServices, who: Instructor) -> Response:
    """Loads the content folder again; with any fault the page lists all of them, and what was loaded before stays."""
    with suppress(ContentError):
        services.reload_content(who)
        return RedirectResponse(f"{PAGE}/content?loaded=yes", 303)
    return RedirectResponse(f"{PAGE}/content", 303)


@router.get(f"{PAGE}/certificates")
def certificates(request: Request, services: AppServices, who: Instructor, *, luck: bool = False) -> Response:
    """Every answer key, derived again by simulation, and with `luck` the chance that a fixed answer passes. Raises
    Unauthorized, Forbidden."""
    rows = list_certificates(services.library_for(who), services.content.archive.passed, with_luck=luck)
    return page(request, "certificates.html", who=who, rows=rows)
