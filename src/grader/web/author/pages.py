"""The pages of `grader author`: a question, the forms that try and save, and what waits for changes."""

import time
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import Header, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse, RedirectResponse, Response

from grader.errors import Conflict, ContentError, NotFound, Outdated
from grader.gate.late_routes import page_router
from grader.grading.report import Report
from grader.library import Library
from grader.library.scaffold import list_exercise_kinds
from grader.questions import installed_kinds, kind_of
from grader.web.author.desk import AuthorDesk, Check, list_about
from grader.web.author.preview import STATES, build_preview, list_samples, try_form
from grader.web.author.source import ShownSource
from grader.web.frame.inputs import FormFields
from grader.web.frame.rendering import page
from grader.web.verdict.key_plot import draw_key

FAST_S = 0.9
"""How long a page waits for the check; a longer one is shown when it is done [s]."""

WAIT_S, POLL_S = 20.0, 0.3
"""How long a browser waits for a change in one request, and how often the folder is looked at [s]."""

SOURCE_BYTES_MAX = 1 << 20

router = page_router()


def get_desk(request: Request) -> AuthorDesk:
    """Returns the desk of this process."""
    desk: AuthorDesk = request.app.state.desk
    return desk


def address_page(quiz: str, question: str) -> str:
    """Returns the address of the page of a question, by their names."""
    return f"/edit/{quote(quiz, safe='')}/{quote(question, safe='')}"


@router.get("/")
def begin(request: Request) -> Response:
    """The first question; a page without one where there is none."""
    for quiz, questions in get_desk(request).list_questions():
        if questions:
            return RedirectResponse(address_page(quiz, next(iter(questions))), 303)
    return page(request, "author_empty.html", root=get_desk(request).root)


@router.get("/edit/{quiz}/{question}")
def show(quiz: str, question: str, request: Request, state: str = "unanswered", shown: str = "") -> Response:
    """A question: its source, its preview in a state, and what the check says. A page that is open already names what
    is `shown` by its tag: that stays so, even if it is no question for the moment. Raises NotFound."""
    return render(request, quiz, question, state if state in STATES else "unanswered", shown=shown)


@router.post("/try/{quiz}/{question}")
def try_answer(quiz: str, question: str, request: Request, fields: FormFields) -> Response:
    """The same page after an answer; nothing is stored. Raises NotFound."""
    answer = {name: values for name, values in fields.items() if name.partition(".")[0] == "answer"}
    return render(request, quiz, question, "", answer)


@router.post("/source/{quiz}/{question}")
def save(quiz: str, question: str, request: Request, fields: FormFields) -> Response:
    """Saves the source of a question by the form of the page. Raises NotFound; of a file that has changed meanwhile
    nothing is saved, and the page shows what was typed beside the reason."""
    sent = {name: values[0] for name, values in fields.items()}
    source, tag = sent.get("source", "").replace("\r\n", "\n"), sent.get("tag", "")
    try:
        saved = get_desk(request).save_source(quiz, question, source, tag)
    except Outdated as error:
        return render(request, quiz, question, "unanswered", shown=tag, typed=source, trouble=str(error))
    return RedirectResponse(address_page(quiz, saved.question), 303)


@router.post("/add/{quiz}/{question}")
def add(quiz: str, question: str, request: Request, fields: FormFields) -> Response:
    """Adds an example of a kind to the quiz of this page, and shows it; where it cannot be added, says why beside this
    question. Raises NotFound."""
    try:
        added = get_desk(request).add_question(quiz, fields.get("kind", [""])[0])
    except (Conflict, ContentError) as error:
        return render(request, quiz, question, "unanswered", trouble=str(error))
    return RedirectResponse(address_page(quiz, added), 303)


@router.put("/source/{quiz}/{question}")
async def put_source(quiz: str, question: str, request: Request, if_match: Annotated[str, Header()] = "") -> Response:
    """Saves the source of a question for the script of the page: 204 with the new tag, and the address of its page
    where the question has another name now; 412 where it has changed since it had the tag of `If-Match`, and 413 for
    more than SOURCE_BYTES_MAX. Raises NotFound."""
    desk, sent = get_desk(request), await request.body()
    if len(sent) > SOURCE_BYTES_MAX:
        return JSONResponse({"why": f"Nothing was saved: a question has at most {SOURCE_BYTES_MAX >> 20} MB."}, 413)
    source = sent.decode(errors="replace")
    try:
        saved = await run_in_threadpool(desk.save_source, quiz, question, source, if_match.strip('"'))
    except Outdated as error:
        return JSONResponse({"why": str(error)}, 412)
    moved = {} if saved.question == question else {"Location": address_page(quiz, saved.question)}
    return Response(None, 204, {"ETag": f'"{saved.tag}"'} | moved)


@router.get("/changes/{quiz}/{question}")
def wait_for_change(quiz: str, question: str, request: Request, seen: str = "") -> Response:
    """Answers once the folder or the check is no more as the browser has `seen` it, at the latest after WAIT_S."""
    desk, last = get_desk(request), time.monotonic() + WAIT_S
    while (now := read_state(desk, quiz, question)) == seen and time.monotonic() < last:
        time.sleep(POLL_S)
    check = desk.checks.get((quiz, question))
    return JSONResponse({"state": now, "doing": check.doing if check is not None and check.report is None else ""})


def read_state(desk: AuthorDesk, quiz: str, question: str) -> str:
    """Returns what a page would show now, as one text: the revision of the folder, and whether its check is done."""
    check, revision = desk.checks.get((quiz, question)), desk.read_revision()
    return write_state(revision, check is not None and check.revision == revision and check.report is not None)


def write_state(revision: str, is_done: bool) -> str:
    """Returns a state as one text."""
    return f"{revision}-{'done' if is_done else 'runs'}"


def render(
    request: Request, quiz: str, question: str, state: str, answer: dict[str, list[str]] | None = None, *,
    shown: str = "", typed: str | None = None, trouble: str = "",
) -> Response:  # fmt: skip
    """Renders the page of one question. Raises NotFound."""
    desk = get_desk(request)
    source = desk.read_source(quiz, question, shown)
    check = desk.check(quiz, question)
    report = desk.wait_for_report(check, FAST_S)
    loaded, quizzes = desk.load(quiz), desk.list_questions()
    seen_by = describe(loaded, quiz, question, state, answer) if isinstance(loaded, Library) else {"preview": None}
    question_id = dict(quizzes).get(quiz, {}).get(question, question)
    return page(
        request, "author.html", quizzes=quizzes, quiz={"id": quiz}, question=question, question_id=question_id,
        file=source.file, source=source.source if typed is None else typed, tag=source.tag, is_whole=source.is_whole,
        trouble=trouble, is_writable=desk.is_writable, state=state, states=STATES,
        # Of the check, not of the folder: what has changed since then is not on this page.
        seen=write_state(check.revision, report is not None), seen_as=state == "due", learner="",
        exercises=list_exercise_kinds(),
        kinds=[name for name, kind in installed_kinds().items() if not kind.is_script],
        **describe_report(report, check, loaded, source, question_id), **seen_by,
    )  # fmt: skip


def describe(
    library: Library, quiz_id: str, question_id: str, state: str, answer: dict[str, list[str]] | None
) -> dict[str, Any]:
    """Returns the preview, and how answers are read. Raises NotFound."""
    quiz, question = library.quiz(quiz_id), library.question(quiz_id, question_id)
    if answer is None:
        preview = build_preview(library, quiz, question, state)
    else:
        preview = try_form(library, quiz, question, answer)
    starter = library.starter(question) if kind_of(question).is_script else None
    return {"preview": preview, "samples": list_samples(question), "starter": starter}


def describe_report(
    report: Report | None, check: Check, loaded: Library | list[Any], source: ShownSource, question_id: str
) -> dict[str, Any]:
    """Returns what a check says of the question with an id, for the template; what does not load is told before the
    check is done."""
    faults = loaded if isinstance(loaded, list) else [] if report is None else [*report.faults, *report.undecided]
    return {
        "faults": [source.place(fault) for fault in list_about(faults, source.file, question_id)],
        "remarks": [] if report is None else [source.place(remark) for remark in report.warnings],
        "certificates": []
        if report is None
        else [certificate | {"figure": draw_key(certificate)} for certificate in report.certificates],
        "proposals": [] if report is None else report.proposals,
        "references": [] if report is None else report.references,
        "luck": [] if report is None else report.chances,
        "doing": check.doing if report is None else "",
    }


async def refuse(request: Request, error: Exception) -> Response:
    """Renders an error as a page."""
    status = 404 if isinstance(error, NotFound) else 409
    return page(request, "author_empty.html", status, root=get_desk(request).root, why=str(error))
