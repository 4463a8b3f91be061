"""The scripts of all who made one mistake, side by side, and one comment to all of them. It needs no script."""

import json
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import RedirectResponse, Response

from grader.courses.reviewing.line_comments import write_comment
from grader.courses.rules.mistakes import Family
from grader.errors import NotFound
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.store import submissions
from grader.store.tables import ERASED
from grader.web.cohort.answers_page import ClassAt, make_address, read_class
from grader.web.frame.inputs import Form, Instructor, Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.statistics import CLASS
from grader.web.learner.pages import show_sign_in

SCRIPTS = 6
"""Scripts on one page."""

router = page_router()

Key = Annotated[str, Query(max_length=32)]


@dataclass(frozen=True)
class ShownScript:
    """One of the scripts: whose it is, and its lines; `hot` is the one that the verdict names."""

    name: str
    address: str
    attempt: int
    is_still: bool
    lines: tuple[str, ...]
    hot: int | None
    sentence: str


@router.get(f"{CLASS}/{{quiz_id}}/{{question_id}}/scripts")
def show_scripts(
    request: Request, services: AppServices, who: Visitor, quiz_id: str, question_id: str, *, mistake: Key = "",
    start: Annotated[int, Query(ge=0, le=10_000)] = 0,
) -> Response:  # fmt: skip
    """The scripts of a mistake; anyone but an instructor is told to sign in. Raises NotFound."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    at = read_class(services, who, quiz_id, question_id)
    family = find_family(at, mistake)
    listed = [
        *((attempt.submission, True) for attempt in family.still),
        *((attempt.submission, False) for attempt in family.was),
    ]
    with services.database.read() as session:
        rows = {row.id: row.answer for row in submissions.get_several(session, [id_ for id_, _ in listed])}
    shown = listed[start : start + SCRIPTS]
    scripts = [make_script(at, id_, rows[id_], is_still=is_still) for id_, is_still in shown]
    following = start + SCRIPTS if len(listed) > start + SCRIPTS else None
    context: dict[str, Any] = {"at": at, "family": family, "scripts": scripts, "start": start, "following": following}
    return page(request, "class_scripts.html", who=who, **context)


def find_family(at: ClassAt, key: str) -> Family:
    """Returns the mistake of this key. Raises NotFound where no answer ends in it, or the answers are files."""
    if not at.shows_scripts:
        raise NotFound("The answers to this question are no scripts.")
    family = at.find_family(key)
    if family is None:
        raise NotFound("No answer ends in this mistake any more.")
    return family


def make_script(at: ClassAt, submission: str, answer: str, *, is_still: bool) -> ShownScript:
    """Returns one script; without lines where it was erased."""
    attempt = at.answers.find(submission)
    assert attempt is not None
    value = json.loads(answer) if answer else None
    source = str(value.get("source", "")) if isinstance(value, dict) else ""
    sentence = "" if attempt.mistake is None else attempt.mistake.sentence
    return ShownScript(
        attempt.name,
        make_address(attempt),
        attempt.number,
        is_still,
        tuple(source.splitlines()),
        attempt.line,
        sentence,
    )


@router.post(f"{CLASS}/{{quiz_id}}/{{question_id}}/comment")
def comment_all(services: AppServices, who: Instructor, quiz_id: str, question_id: str, form: Form) -> Response:
    """Writes one comment to the script of each learner who still makes a mistake, else of each who made it. Raises
    Unauthorized, Forbidden, NotFound, Unprocessable."""
    at = read_class(services, who, quiz_id, question_id)
    family = find_family(at, form.get("mistake", ""))
    attempts = [at.answers.find(attempt.submission) for attempt in family.still or family.was]
    lines = {attempt.id: attempt.line for attempt in attempts if attempt is not None}
    with services.database.write() as session:
        found = submissions.get_several(session, list(lines))
        rows = [(row, lines[row.id]) for row in found if row.answer != ERASED]
        written = write_comment(session, who, rows, form.get("text", "").replace("\r\n", "\n"))
    return RedirectResponse(f"{at.path}?said={len(written)}#m-{family.key}", 303)
