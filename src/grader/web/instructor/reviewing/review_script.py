"""What a reviewer does with a script beside marking it: comments on its lines, and a changed copy that is run. It needs
no script."""

import asyncio
import json
from functools import partial
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from grader.courses.answering.intake import NewAnswer
from grader.courses.people.identity import Identity
from grader.courses.people.namesakes import make_marks
from grader.courses.reviewing.blinding import hide_names
from grader.courses.reviewing.line_comments import delete_comment, read_source, write_comment
from grader.errors import CallerError, NotFound, Unprocessable
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.store import submissions
from grader.store.reviewing import line_comments
from grader.store.reviewing.line_comments import TriedCopy
from grader.store.submissions import AT_REST
from grader.store.tables import Submission
from grader.web.frame.inputs import Form, Instructor, Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.reviewing.review import AtDesk, get_submission, render
from grader.web.instructor.reviewing.review_list import PAGE, name_learner
from grader.web.learner.pages import show_sign_in
from grader.web.text.questions import list_titles
from grader.web.verdict.card import build_card
from grader.web.verdict.work import read_in_full

WAIT_S, LOOK_S = 20.0, 0.3
"""How long a page waits for the verdict on a changed copy, and how often it looks [s]."""

COPIES = 8
"""Copies that are listed."""

router = page_router()


@router.post(f"{PAGE}/{{submission_id}}/lines")
def change_lines(request: Request, submission_id: str, at: AtDesk, form: Form) -> Response:
    """Writes or deletes a comment on a line; shows the page again with what was typed if it is refused. Raises
    Unauthorized, Forbidden, NotFound."""
    text = form.get("text", "").replace("\r\n", "\n")
    try:
        with at.services.database.write() as session:
            row = get_submission(session, at.who, submission_id)
            if form.get("do") == "delete":
                delete_comment(session, at.who, form.get("comment", ""), row.id)
            else:
                write_comment(session, at.who, [(row, parse_line(form.get("line", "")))], text)
    except Unprocessable as error:
        typed = {"line": form.get("line", ""), "text": text}
        return render(request, at, submission_id, 422, trouble=str(error), line_typed=typed)
    return at.redirect(f"{PAGE}/{submission_id}")


def parse_line(text: str) -> int | None:
    """Returns the number of a line; None for the whole script. Raises Unprocessable."""
    if not text.strip():
        return None
    if not text.strip().isdecimal() or len(text.strip()) > 6:
        raise Unprocessable("The line is a number, such as 12.")
    return int(text)


@router.get(f"{PAGE}/{{submission_id}}/try")
def show_try(
    request: Request, services: AppServices, who: Visitor, submission_id: str, *,
    copy: Annotated[str, Query(pattern="^[0-9a-f]{0,32}$")] = "",
) -> Response:  # fmt: skip
    """A learner's script to be changed and run, or a copy of this instructor's; to anyone else, how to sign in. Raises
    NotFound, Unprocessable."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    return render_try(request, services, who, submission_id, copy=copy)


@router.post(f"{PAGE}/{{submission_id}}/try")
async def run_copy(
    request: Request, services: AppServices, who: Instructor, submission_id: str, form: Form
) -> Response:
    """Runs a changed copy as the instructor's own submission, and waits a while for its verdict.

    It has the hidden cases of the learner's, which stays as it is. Raises Unauthorized, Forbidden, NotFound."""
    source = form.get("source", "").replace("\r\n", "\n")
    try:
        answer = await run_in_threadpool(read_copy, services, who, submission_id, source)
        receipt = await services.writer.put(answer)
    except NotFound:
        raise
    except CallerError as error:
        show = partial(render_try, typed=source, trouble=str(error), status=422)
        return await run_in_threadpool(show, request, services, who, submission_id)
    copy = receipt.submission.id
    await run_in_threadpool(note_copy, services, copy, submission_id)
    for _ in range(int(WAIT_S / LOOK_S)):
        if await run_in_threadpool(is_judged, services, copy):
            break
        await asyncio.sleep(LOOK_S)
    return RedirectResponse(f"{PAGE}/{submission_id}/try?copy={copy}", 303)


def read_copy(services: Services, who: Identity, submission_id: str, source: str) -> NewAnswer:
    """Reads a changed copy. Raises NotFound, Unprocessable, TooLarge."""
    with services.database.read() as session:
        row = get_submission(session, who, submission_id)
        read_source(row)
    pipeline = services.get_pipeline(who)
    parsed = pipeline.read(row.quiz, row.question, {"source": source}, row.seed)
    if parsed.refusal is not None:
        raise Unprocessable(parsed.refusal)
    return NewAnswer(who, pipeline.library, parsed, None, None, services.settings.queue_per_user)


def note_copy(services: Services, copy: str, original: str) -> None:
    """Keeps what a submission is a copy of, so that it is erased with the learner's."""
    with services.database.write() as session:
        session.add(TriedCopy(submission_id=copy, original=original))


def is_judged(services: Services, submission_id: str) -> bool:
    """Says whether a submission has its verdict."""
    with services.database.read() as session:
        row = submissions.get(session, submission_id)
        return row is None or row.status in AT_REST


def render_try(
    request: Request, services: Services, who: Identity, submission_id: str, *, copy: str = "",
    typed: str | None = None, trouble: str = "", status: int = 200,
) -> Response:  # fmt: skip
    """Renders the page: the copy, its verdict, and that on the learner's script. Raises NotFound, Unprocessable."""
    desk = services.desk_of(who.course)
    read = services.answers_in(desk.library)
    with services.database.read() as session:
        row = get_submission(session, who, submission_id)
        source = read_source(row)
        seen = hide_names(desk, session, who, [row], submissions.read_verdicts(session, [row]))
        learner = name_learner(row, seen.names, make_marks(session, who.course))
        original = build_card(read_in_full(row, read(row), seen.verdicts.get(row.id)))
        copies = line_comments.list_copies(session, row.id, who.id)[:COPIES]
        chosen = find_copy(session, copies, copy)
        verdicts = {} if chosen is None else submissions.read_verdicts(session, [chosen])
    if chosen is not None and typed is None:
        typed = str(json.loads(chosen.answer)["source"]) if chosen.answer else ""
    context: dict[str, Any] = {
        "id": submission_id,
        "learner": learner,
        "title": f"{row.quiz}: {list_titles(services.library_for(who)).get((row.quiz, row.question), row.question)}",
        "source": source if typed is None else typed,
        "original": original,
        "copies": copies,
        "copy": chosen,
        "card": None if chosen is None else build_card(read_in_full(chosen, read(chosen), verdicts.get(chosen.id))),
        "trouble": trouble,
    }
    return page(request, "review_try.html", status, who=who, **context)


def find_copy(session: Session, copies: list[str], wanted: str) -> Submission | None:
    """Returns the copy of this id; None without one. Raises NotFound for another submission."""
    if not wanted:
        return None
    if wanted not in copies:
        raise NotFound("You have run no such copy.")
    return submissions.get(session, wanted)
