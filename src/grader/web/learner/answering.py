"""Handing in from a page: a form without JavaScript, answered by a redirect, or by the page with the reason."""

import re
from dataclasses import dataclass
from functools import partial

from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse, Response

from grader.courses.answering.intake import NewAnswer
from grader.courses.answering.stopping import stop
from grader.courses.people.identity import Identity
from grader.courses.people.sign_in import start_anonymous_session
from grader.domain.verdict import Status
from grader.errors import CallerError, Conflict, InvalidAnswer, NotFound, TooLarge, TooManyRequests, Unauthorized
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.grading.pipeline import ParsedSubmission
from grader.questions import FIELD, Fields, Question, kind_of
from grader.store import submissions
from grader.store.tables import Member
from grader.web.frame.inputs import Form, FormFields, Visitor
from grader.web.frame.rendering import page
from grader.web.learner.lesson import TypedAnswer
from grader.web.learner.pages import SIGN_IN, show_exercise, show_lesson

router = page_router()

BACK = re.compile(r"/(lessons/[\w.-]+|\?quiz=[\w.-]+)?", re.ASCII)
"""The addresses of pages with questions, to one of which a learner returns."""

STATUSES: dict[type[CallerError], int] = {Conflict: 409, TooLarge: 413, TooManyRequests: 429}

OWN_NUMBERS = "From now on this question has numbers of your own: read it again."
SAME = "This is what you sent last time. Change it first."
UNTOUCHED = "No attempt was used."


@dataclass(frozen=True)
class Sender:
    """Who sends an answer; `cookie` begins a session on loopback with the first one."""

    who: Identity
    cookie: str | None = None


class RefusedAnswer(Exception):
    """An answer that is not taken: it touches nothing, and is shown again with the reason."""

    def __init__(self, why: str, status: int = 422) -> None:
        super().__init__(why)
        self.why, self.status = why, status


@router.post("/quizzes/{quiz_id}/{question_id}")
async def hand_in(
    quiz_id: str, question_id: str, *, request: Request, services: AppServices, visitor: Visitor, form: Form,
    sent: FormFields,
) -> Response:  # fmt: skip
    """Takes an answer, and redirects to where it is shown. Raises NotFound, and Conflict before the quiz opens."""
    fields = answer_fields(sent)
    sender = await run_in_threadpool(find_sender, services, visitor, form.get("learner", ""))
    if sender is None:
        is_file = request.headers.get("content-type", "").startswith("multipart/")  # which is no text to take along
        typed = "" if is_file else "\n".join(value for values in fields.values() for value in values)
        begin = await run_in_threadpool(begins_again, services, form.get("learner", ""))
        kept = {"who": visitor, "typed": typed, "begin": begin}
        return page(request, "signed_out.html", 401, {"Cache-Control": "no-store"}, **kept)
    library = services.library_for(sender.who)
    question = library.question(quiz_id, question_id)
    await run_in_threadpool(services.require_opened, library, sender.who, quiz_id)
    is_script = kind_of(question).is_script
    back = choose_page(form.get("back", ""), quiz_id)
    try:
        if not form.get("learner") and (quiz_id, question_id) in services.get_pipeline(sender.who).drawn:
            raise RefusedAnswer(f"{OWN_NUMBERS} {UNTOUCHED}")
        await take_answer(services, sender.who, quiz_id, question, fields=fields, after=form.get("after", ""))
    except RefusedAnswer as refused:
        shown = TypedAnswer(quiz_id, question_id, fields, refused.why)
        of_exercise = partial(show_exercise, quiz_id=quiz_id, question_id=question_id)
        show = of_exercise if is_script else partial(show_lesson, address=back)
        response = await run_in_threadpool(show, request, services, sender.who, typed=shown, status=refused.status)
    else:
        target = f"/quizzes/{quiz_id}/{question_id}" if is_script else f"{back}#{quiz_id}--{question_id}"
        response = RedirectResponse(target, 303, {"Cache-Control": "no-store"})
    if sender.cookie is not None:
        response.headers["Set-Cookie"] = sender.cookie
    return response


@router.post("/quizzes/{quiz_id}/{question_id}/stop")
async def stop_script(
    quiz_id: str, question_id: str, *, request: Request, services: AppServices, who: Visitor, sent: FormFields
) -> Response:
    """Stops a script, and shows the exercise with what is in the editor. Raises Unauthorized, NotFound."""
    if who is None:
        raise Unauthorized(SIGN_IN)
    return await run_in_threadpool(show_stopped, request, services, who, at=(quiz_id, question_id), sent=sent)


def show_stopped(request: Request, services: Services, who: Identity, *, at: tuple[str, str], sent: Fields) -> Response:
    """Renders the exercise after a script was stopped, or could not be. Raises NotFound."""
    status = 200
    try:
        why = stop(services.database, services.library_for(who), who, next(iter(sent.get("stop", ())), ""))
    except Conflict as conflict:
        why, status = str(conflict), 409
    typed = TypedAnswer(*at, answer_fields(sent), why)
    return show_exercise(request, services, who, quiz_id=at[0], question_id=at[1], typed=typed, status=status)


def find_sender(services: Services, visitor: Identity | None, learner: str) -> Sender | None:
    """Says who sends the form; None if the session of the `learner` who opened the page has ended, or is another's now.
    On loopback the first answer begins a session."""
    if visitor is not None:
        return Sender(visitor) if learner in ("", visitor.id) else None
    if learner or not services.sessions.anonymous:
        return None
    opened = services.sessions.writing(start_anonymous_session)
    return Sender(opened.identity, services.sessions.set_cookie(opened))


def begins_again(services: Services, learner: str) -> bool:
    """Whether who sent the form only has to load the page again: on loopback, a learner whom nothing but the session
    made known. Others would go on as somebody else."""
    if not services.sessions.anonymous:
        return False
    member = services.sessions.reading(lambda session: session.get(Member, learner))
    return member is None or member.account is None


def choose_page(wanted: str, quiz_id: str) -> str:
    """Returns the page that a form came from, if it is one of ours; else that of the quiz."""
    return wanted if BACK.fullmatch(wanted) else f"/?quiz={quiz_id}"


async def take_answer(
    services: Services, who: Identity, quiz_id: str, question: Question, *, fields: Fields, after: str
) -> None:
    """Hands in what was typed. Raises RefusedAnswer if it cannot be read or is not taken now, and Unauthorized."""
    try:
        answer = await run_in_threadpool(read_answer, services, who, quiz_id, question, fields=fields, after=after)
        await services.writer.put(answer)
    except (NotFound, Unauthorized):
        raise
    except CallerError as error:
        raise RefusedAnswer(str(error), STATUSES.get(type(error), 422)) from error


def read_answer(
    services: Services, who: Identity, quiz_id: str, question: Question, *, fields: Fields, after: str
) -> NewAnswer:
    """Reads an answer, and grades it where that is instant. Raises RefusedAnswer for what cannot be read."""
    pipeline, kind = services.get_pipeline(who), kind_of(question)
    try:
        answer = kind.from_form(question, fields)
    except InvalidAnswer as error:
        raise RefusedAnswer(str(error)) from error
    parsed, verdict = pipeline.read_and_grade(quiz_id, question.id, answer, who.drawn_for)
    if verdict is not None and verdict.status is Status.INVALID_ANSWER:
        raise RefusedAnswer(f"{verdict.diagnosis or 'This answer could not be read.'} {UNTOUCHED}")
    if not kind.is_script and is_repeated(services, who, quiz_id, parsed, after):
        raise RefusedAnswer(f"{SAME} {UNTOUCHED}")
    key = f"page-{after[:64]}-{parsed.digest[:32]}"  # the same answer from the same form is one submission
    return NewAnswer(who, pipeline.library, parsed, verdict, key, services.settings.queue_per_user)


def is_repeated(services: Services, who: Identity, quiz_id: str, parsed: ParsedSubmission, after: str) -> bool:
    """Says whether the answer `after` which the form was made is the same: to send it again would come to the same."""
    with services.database.read() as session:
        last = submissions.get(session, after) if after.isalnum() else None
    return (
        last is not None
        and (last.learner, last.quiz, last.question, last.answer) == (who.id, quiz_id, parsed.question.id, parsed.text)
        and last.content_digest == services.library_for(who).digest(quiz_id)
        and last.outcome != Status.GRADER_FAULT
    )


def answer_fields(sent: Fields) -> dict[str, list[str]]:
    """Returns the fields of a form that belong to the answer, with the line ends of the API."""
    return {
        name: [value.replace("\r\n", "\n") for value in values]
        for name, values in sent.items()
        if name == FIELD or name.startswith(f"{FIELD}.")
    }
