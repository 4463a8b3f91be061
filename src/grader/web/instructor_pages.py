"""What an instructor sees: what needs a person today, the desk for reviews, people, and answer keys."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response
from sqlalchemy.orm import Session

from grader.courses.blinding import blinded
from grader.courses.today import COUNTED_MAX, Today, today_of
from grader.domain.markup import plain_text
from grader.domain.quiz import OpenQuestion, Question
from grader.errors import NotFound
from grader.identity import DEFAULT_COURSE, Identity, Role, Scope
from grader.library import Library
from grader.lms import administration
from grader.queue import jobs
from grader.store import submissions
from grader.store.reviews import Waits
from grader.store.tables import now
from grader.web.certificates import certificate_rows
from grader.web.context import Pages, Visitor, instructor
from grader.web.figures import span
from grader.web.page import page_of
from grader.web.prose import cached_prose
from grader.web.rendering import page
from grader.web.student_pages import sign_in_page
from grader.web.verdict_card import card_of
from grader.web.work import Given, given_in_full

PAGE = "/instructor"
REVIEW = f"{PAGE}/review"

router = APIRouter(include_in_schema=False)


@dataclass(frozen=True)
class Line:
    """How many answers to a question wait, for how long, and where they are decided."""

    title: str
    count: int
    oldest: str
    address: str


@dataclass(frozen=True)
class Task:
    """One kind of things that need a person."""

    count: str
    title: str
    lines: tuple[Line, ...]
    address: str
    verb: str


@router.get(PAGE)
def home(request: Request, pages: Pages, who: Visitor) -> Response:
    """What needs a person today, and how far the queue is; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return sign_in_page(request, pages, who)
    library = pages.library_for(who)
    with pages.database.read() as session:
        today = today_of(pages.desk_of(who.course), session, who)
        asked = waiting_platforms(session, who)
        alive, scripts = pages.workers_alive(session), jobs.state(session)[jobs.GRADE]
    tasks = [*tasks_of(library, today), *platform_tasks(asked)]
    faults = list(map(str, library.warnings))
    return page(request, "today.html", who=who, tasks=tasks, today=today, faults=faults, alive=alive, scripts=scripts)


def tasks_of(library: Library, today: Today) -> list[Task]:
    """The reviews that wait, as the page shows them."""
    kinds = (
        ("reviews", today.first, "wait for a review", "Review"),
        ("second", today.second, "wait for your second mark", "Mark"),
        ("disagreements", today.differing, "have two marks that differ", "Decide"),
    )
    return [task_of(library, which, waiting, words, verb) for which, waiting, words, verb in kinds if waiting]


def task_of(library: Library, which: str, waiting: Sequence[Waits], words: str, verb: str) -> Task:
    """One kind of reviews, by question."""
    total, address = sum(one.answers for one in waiting), f"{REVIEW}?which={which}"
    lines = tuple(
        Line(
            title_of(library, one.quiz, one.question),
            one.answers,
            span((now() - one.since).total_seconds()),
            f"{address}&quiz={one.quiz}&question={one.question}",
        )
        for one in waiting
    )
    if total == 1:
        words = words.replace("wait ", "waits ").replace("have ", "has ")
    count = f"{total}+" if total >= COUNTED_MAX else str(total)
    return Task(count, f"answer{'' if total == 1 else 's'} {words}", lines, address, verb)


def title_of(library: Library, quiz: str, question: str) -> str:
    """The title of a question, or its id where it has none or the content has lost it."""
    found = library.quizzes.get(quiz)
    named = next((one for one in found.questions if one.id == question), None) if found else None
    title = plain_text((named and (named.title or named.label)) or question)
    return f"{quiz}: {title}"


def waiting_platforms(session: Session, who: Identity) -> list[str]:
    """What learning platforms wait for: links to this course, and for administrators their approval."""
    contexts = administration.contexts_of(session, who.course)
    asked = [f"{one['title']} asks for a link" for one in contexts if not one["course"]]
    platforms = administration.platforms_of(session) if who.course == DEFAULT_COURSE else []
    return asked + [f"{one['name']} waits for approval" for one in platforms if not is_approved(one)]


def is_approved(platform: Mapping[str, Any]) -> bool:
    """Whether neither a platform nor one of its deployments waits."""
    return platform["approved"] and all(one["approved"] for one in platform["deployments"])


def platform_tasks(asked: Sequence[str]) -> Iterable[Task]:
    """The platforms that wait, if any do."""
    if asked:
        lines = tuple(Line(one, 1, "", "/instructor/lti") for one in asked)
        title = "request of a learning platform" if len(asked) == 1 else "requests of learning platforms"
        yield Task(str(len(asked)), title, lines, "/instructor/lti", "Open")


WHICH = {
    "reviews": "waiting for a review",
    "second": "waiting for my second mark",
    "disagreements": "two marks that differ",
    "submissions": "all",
}
"""The lists of the desk, by the value of `which`."""

Name = Annotated[str, Query(max_length=64)]


@router.get(REVIEW)
def review(
    request: Request, pages: Pages, who: Visitor, *, which: Name = "reviews", quiz: Name = "", question: Name = ""
) -> Response:
    """The desk: a list of answers, and one of them with its review. To anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return sign_in_page(request, pages, who)
    chosen: dict[str, Any] = {"which": which, "quiz": quiz, "question": question}
    quizzes = [page_of(pages.library_for(who), one) for one in pages.library_for(who).quizzes.values() if one.questions]
    return page(request, "review.html", who=who, quizzes=quizzes, lists=WHICH, chosen=chosen)


@router.get(f"{REVIEW}/{{submission_id}}")
def answer(request: Request, submission_id: str, pages: Pages, who: Visitor) -> Response:
    """One answer with its question and verdict, as a part of the desk. Raises Unauthorized, Forbidden, NotFound."""
    who = instructor(who)
    desk = pages.desk_of(who.course)
    with pages.database.read() as session:
        row = submissions.get(session, submission_id) if submission_id.isalnum() else None
        if row is None or not who.may_see(row.learner, row.course):
            raise NotFound("There is no such submission.")
        seen = blinded(desk, session, who, [row], submissions.verdicts(session, [row]))
        given = given_in_full(row, seen.verdicts.get(row.id))
        learner, question = seen.names.get(row.id, row.user), desk.question(row)
    card = card_of(given)
    if card is None:
        raise NotFound("This submission has no verdict yet.")
    shown = {"title": title_of(desk.library, row.quiz, row.question), **asked(desk.library, row.quiz, question, given)}
    return page(request, "review_answer.html", card=card, learner=learner, **shown)


def asked(library: Library, quiz: str, question: Question | None, given: Given) -> dict[str, Any]:
    """What the desk says of a question: its text, the chosen option, and the reference; little once it is gone."""
    if question is None:
        return {}
    view = next(one for one in page_of(library, library.quiz(quiz))["questions"] if one["id"] == question.id)
    is_text = isinstance(question, OpenQuestion)
    chosen = given.answer if view["options"] and isinstance(given.answer, int) else -1
    return {
        "view": view,
        "option": view["options"][chosen] if 0 <= chosen < len(view["options"]) else "",
        "is_text": is_text,
        "words": len(given.text.split()) if is_text else 0,
        "reference": cached_prose((question.reference or "") if isinstance(question, OpenQuestion) else ""),
    }


@router.get(f"{PAGE}/people")
def people(request: Request, pages: Pages, who: Visitor) -> Response:
    """Members, invitations, tokens, the course link and the audit log; the page's script fills them in."""
    if who is None or not who.is_instructor:
        return sign_in_page(request, pages, who)
    return page(request, "people.html", who=who, roles=list(Role), scopes=list(Scope))


@router.get(f"{PAGE}/content")
def content(request: Request, pages: Pages, who: Visitor) -> Response:
    """The quizzes that are loaded, and what was remarked on them; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return sign_in_page(request, pages, who)
    library = pages.library_for(who)
    quizzes = [page_of(library, quiz) | {"digest": library.digest(quiz.id)} for quiz in library.quizzes.values()]
    return page(request, "content.html", who=who, quizzes=quizzes, remarks=library.warnings)


@router.get(f"{PAGE}/certificates")
def certificates(request: Request, pages: Pages, who: Visitor, *, luck: bool = False) -> Response:
    """Every answer key, derived again by simulation, and with `luck` the chance that a fixed answer passes.

    Raises Unauthorized, Forbidden.
    """
    who = instructor(who)
    rows = certificate_rows(pages.library_for(who), with_luck=luck)
    return page(request, "certificates.html", who=who, rows=rows)
