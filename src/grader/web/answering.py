"""Handing in from a page: a form without JavaScript, answered by a redirect, or by the page with the reason."""

import re
from dataclasses import dataclass
from functools import partial

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse, Response

from grader.courses.handing_in import Answer
from grader.courses.sign_in import start_anonymous_session
from grader.courses.standing import require_opened
from grader.courses.stopping import STOPPED, stop
from grader.domain.quiz import CodeQuestion, Question
from grader.domain.verdict import Status
from grader.errors import CallerError, Conflict, NotFound, TooLarge, TooManyRequests, Unauthorized
from grader.identity import Identity
from grader.pipeline import ParsedSubmission
from grader.store import submissions
from grader.web.context import Form, PageContext, Pages, Visitor
from grader.web.lesson_page import Typed
from grader.web.rendering import page
from grader.web.student_pages import SIGN_IN, show_exercise, show_lesson

router = APIRouter(include_in_schema=False)

BACK = re.compile(r"/(lessons/[\w.-]+|\?quiz=[\w.-]+)?", re.ASCII)
"""The addresses of pages with questions, to one of which a learner returns."""

STATUSES: dict[type[CallerError], int] = {Conflict: 409, TooLarge: 413, TooManyRequests: 429}

NOTHING_CHOSEN = "Choose one of the options first."
NOTHING_TYPED = "Write an answer first."
NO_SCRIPT = "Load or paste your script first."
SAME = "This is what you sent last time. Change it first."
UNTOUCHED = "No attempt was used."


@dataclass(frozen=True)
class Sender:
    """Who sends an answer; `cookie` begins a session on loopback with the first one."""

    who: Identity
    cookie: str | None = None


class Refused(Exception):
    """An answer that is not taken: it touches nothing, and is shown again with the reason."""

    def __init__(self, why: str, status: int = 422) -> None:
        super().__init__(why)
        self.why, self.status = why, status


@router.post("/quizzes/{quiz_id}/{question_id}")
async def hand_in(
    quiz_id: str, question_id: str, *, request: Request, pages: Pages, visitor: Visitor, form: Form
) -> Response:
    """Takes an answer, and redirects to where it is shown. Raises NotFound, and Conflict before the quiz opens."""
    typed = form.get("answer", "").replace("\r\n", "\n")
    sender = await run_in_threadpool(sender_of, pages, visitor, form.get("learner", ""))
    if sender is None:
        kept = {"who": visitor, "typed": typed, "begin": pages.sessions.anonymous}
        return page(request, "signed_out.html", 401, {"Cache-Control": "no-store"}, **kept)
    library = pages.library_for(sender.who)
    question = library.question(quiz_id, question_id)
    require_opened(library, quiz_id, sender.who.role)
    is_code = isinstance(question, CodeQuestion)
    back = back_of(form.get("back", ""), quiz_id)
    try:
        await take(pages, sender.who, quiz_id, question, typed=typed, after=form.get("after", ""))
    except Refused as refused:
        shown = Typed(quiz_id, question_id, typed, refused.why)
        of_exercise = partial(show_exercise, quiz_id=quiz_id, question_id=question_id)
        show = of_exercise if is_code else partial(show_lesson, address=back)
        response = await run_in_threadpool(show, request, pages, sender.who, typed=shown, status=refused.status)
    else:
        target = f"/quizzes/{quiz_id}/{question_id}" if is_code else f"{back}#{quiz_id}--{question_id}"
        response = RedirectResponse(target, 303, {"Cache-Control": "no-store"})
    if sender.cookie is not None:
        response.headers["Set-Cookie"] = sender.cookie
    return response


@router.post("/quizzes/{quiz_id}/{question_id}/stop")
async def stop_script(
    quiz_id: str, question_id: str, *, request: Request, pages: Pages, who: Visitor, form: Form
) -> Response:
    """Stops a script that waits, and shows the exercise with what is in the editor. Raises Unauthorized, NotFound."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    return await run_in_threadpool(stopped, request, pages, who, at=(quiz_id, question_id), form=form)


def stopped(
    request: Request, pages: PageContext, who: Identity, *, at: tuple[str, str], form: dict[str, str]
) -> Response:
    """The exercise after a script was stopped, or could not be. Raises NotFound."""
    why, status = STOPPED, 200
    try:
        with pages.database.write() as session:
            stop(pages.database, pages.library_for(who), session, who, form.get("stop", ""))
    except Conflict as conflict:
        why, status = str(conflict), 409
    typed = Typed(*at, form.get("answer", "").replace("\r\n", "\n"), why)
    return show_exercise(request, pages, who, quiz_id=at[0], question_id=at[1], typed=typed, status=status)


def sender_of(pages: PageContext, visitor: Identity | None, learner: str) -> Sender | None:
    """Who sends the form; None if the session of the `learner` who opened the page has ended, or is another's now.

    On loopback the first answer begins a session.
    """
    if visitor is not None:
        return Sender(visitor) if learner in ("", visitor.id) else None
    if learner or not pages.sessions.anonymous:
        return None
    opened = pages.sessions.writing(start_anonymous_session)
    return Sender(opened.identity, pages.sessions.set_cookie(opened))


def back_of(wanted: str, quiz_id: str) -> str:
    """The page that a form came from, if it is one of ours; else that of the quiz."""
    return wanted if BACK.fullmatch(wanted) else f"/?quiz={quiz_id}"


async def take(pages: PageContext, who: Identity, quiz_id: str, question: Question, *, typed: str, after: str) -> None:
    """Hands in what was typed. Raises Refused if it cannot be read or is not taken now, and Unauthorized."""
    try:
        answer = await run_in_threadpool(read, pages, who, quiz_id, question, typed=typed, after=after)
        await pages.writer.put(answer, answer.receipt)
    except (NotFound, Unauthorized):
        raise
    except CallerError as error:
        raise Refused(str(error), STATUSES.get(type(error), 422)) from error


def read(pages: PageContext, who: Identity, quiz_id: str, question: Question, *, typed: str, after: str) -> Answer:
    """Reads an answer, and grades it where that is instant. Raises Refused for what cannot be read."""
    pipeline = pages.pipeline_for(who)
    parsed = pipeline.read(quiz_id, question.id, value_of(question, typed))
    verdict = pipeline.judge(parsed) if parsed.is_instant else None
    if verdict is not None and verdict.status is Status.INVALID_ANSWER:
        raise Refused(f"{verdict.diagnosis or 'This answer could not be read.'} {UNTOUCHED}")
    if not isinstance(question, CodeQuestion) and is_repeated(pages, who, quiz_id, parsed, after):
        raise Refused(f"{SAME} {UNTOUCHED}")
    key = f"page-{after[:64]}-{parsed.digest[:32]}"  # the same answer from the same form is one submission
    return Answer(who, pipeline.library, parsed, verdict, key, pages.queue_per_user)


def is_repeated(pages: PageContext, who: Identity, quiz_id: str, parsed: ParsedSubmission, after: str) -> bool:
    """Whether the answer `after` which the form was made is the same: to send it again would come to the same."""
    with pages.database.read() as session:
        last = submissions.get(session, after) if after.isalnum() else None
    return (
        last is not None
        and (last.learner, last.quiz, last.question, last.answer) == (who.id, quiz_id, parsed.question.id, parsed.text)
        and last.content_digest == pages.library_for(who).digest(quiz_id)
        and last.outcome != Status.GRADER_FAULT
    )


def value_of(question: Question, typed: str) -> int | str | dict[str, str]:
    """The answer as the API takes it. Raises Refused for an empty one."""
    if question.kind in ("mcq", "debug", "predict"):
        if not (typed.isascii() and typed.isdigit() and len(typed) < 6):
            raise Refused(NOTHING_CHOSEN)
        return int(typed)
    if not typed.strip():
        raise Refused(NO_SCRIPT if isinstance(question, CodeQuestion) else NOTHING_TYPED)
    return {"source": typed} if isinstance(question, CodeQuestion) else typed
