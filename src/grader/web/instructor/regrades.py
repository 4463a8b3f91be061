"""The pages of regrades: start one, see the difference that it makes, apply it, cancel it. They need no script."""

import re
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import RedirectResponse, Response

from grader.courses.people.identity import Identity
from grader.courses.people.namesakes import make_marks
from grader.courses.regrading import regrades
from grader.courses.regrading.regrades import IDS_MAX, SCOPES, RegradeRequest, Scope
from grader.courses.reviewing.blinding import blinded_differences
from grader.errors import CallerError, Unprocessable
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.store import regrades as stored
from grader.store.regrades import UNFINISHED, Regrade
from grader.web.frame.inputs import Form, Instructor, Visitor
from grader.web.frame.rendering import page
from grader.web.learner.pages import show_sign_in
from grader.web.text.questions import list_titles

PAGE = "/instructor/regrades"
SHOWN = 20
"""Regrades in the list."""
ROWS = 100
"""Learners in one table."""
NAMED = "these"
WORDS = {"latest": "the latest", "best": "the best", "all": "all"}
"""The scopes in words."""

router = page_router()


@router.get(PAGE)
def list_page(
    request: Request, services: AppServices, who: Visitor, what: Annotated[str, Query(max_length=129)] = "",
    like: Annotated[str, Query(max_length=32)] = "",
) -> Response:  # fmt: skip
    """The form that starts a regrade, and the newest ones; to anyone but an instructor, how to sign in.

    A quiz or `quiz/question` is chosen, or the form is filled in as for the regrade of the id `like`. Raises NotFound
    without that one."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    form = {"what": what}
    if like:
        with services.database.read() as session:
            form = fill_form(regrades.get(session, like, who.course))
    return render_list(request, services, who, form=form)


@router.post(PAGE)
def start(request: Request, services: AppServices, who: Instructor, form: Form) -> Response:
    """Starts a regrade and redirects to it; shows the form again if it is refused. Raises Unauthorized, Forbidden."""
    try:
        regrade = regrades.create(services.database, services.library_for(who), who, parse_wanted(form))
    except CallerError as error:
        return render_list(request, services, who, 409, trouble=str(error), form=form)
    return RedirectResponse(f"{PAGE}/{regrade.id}", 303)


@router.get(f"{PAGE}/{{regrade_id}}")
def show(
    request: Request, regrade_id: str, services: AppServices, who: Instructor,
    after: Annotated[int, Query(ge=0, lt=10**9)] = 0, *, changed: bool = True,
) -> Response:  # fmt: skip
    """How far a regrade is, and its differences, of `changed` verdicts or of all. Raises NotFound."""
    with services.database.read() as session:
        regrade = regrades.get(session, regrade_id, who.course)
        shown = regrades.describe_regrade(regrade, stored.count_by_outcome(session, regrade))
        page_of = regrades.read_page(session, regrade, after, ROWS + 1, changed=changed)
        rows = blinded_differences(services.desk_of(who.course), session, who, regrade.quiz, page_of)
        marks = make_marks(session, who.course)
    titles = list_titles(services.library_for(who))
    more: dict[str, Any] = {
        "marks": marks,
        "title": titles.get((regrade.quiz, regrade.question or ""), ""),
        "is_asked": any(quiz == regrade.quiz and regrade.question in (None, question) for quiz, question in titles),
        "following": rows[ROWS - 1]["place"] if len(rows) > ROWS else None,
        "running": regrade.status in UNFINISHED,
    }
    listed = sorted(rows[:ROWS], key=lambda row: ((row["user"] or row["learner"]).casefold(), row["place"]))
    return page(request, "regrade.html", who=who, regrade=shown, rows=listed, changed=changed, after=after, **more)


@router.post(f"{PAGE}/{{regrade_id}}/cancel")
def cancel(regrade_id: str, services: AppServices, who: Instructor) -> Response:
    """Cancels a regrade and redirects to it. Raises Unauthorized, Forbidden, NotFound, Conflict."""
    with services.database.write() as session:
        regrades.cancel(session, who, regrade_id)
    return RedirectResponse(f"{PAGE}/{regrade_id}", 303)


@router.post(f"{PAGE}/{{regrade_id}}/apply")
def apply(request: Request, regrade_id: str, services: AppServices, who: Instructor) -> Response:
    """Starts what a dry run has tried, by the content as it is now, and redirects to it."""
    with services.database.read() as session:
        tried = regrades.restore_wanted(regrades.get(session, regrade_id, who.course))
    try:
        regrade = regrades.create(services.database, services.library_for(who), who, tried)
    except CallerError as error:
        return render_list(request, services, who, 409, trouble=str(error))
    return RedirectResponse(f"{PAGE}/{regrade.id}", 303)


def fill_form(regrade: Regrade) -> dict[str, str]:
    """Returns the fields of the form that starts a regrade of the same scope."""
    wanted = regrades.restore_wanted(regrade)
    what = wanted.quiz if wanted.question is None else f"{wanted.quiz}/{wanted.question}"
    if isinstance(wanted.scope, str):
        return {"what": what, "scope": wanted.scope}
    return {"what": what, "scope": NAMED, "ids": "\n".join(wanted.scope)}


def render_list(
    request: Request, services: Services, who: Identity, status: int = 200, *, trouble: str = "",
    form: Mapping[str, str] | None = None,
) -> Response:  # fmt: skip
    """Renders the page with the form, filled in with the fields of `form`, and the list."""
    with services.database.read() as session:
        rows = stored.page(session, who.course, None, SHOWN)
        listed = [regrades.describe_regrade(regrade, stored.count_by_outcome(session, regrade)) for regrade in rows]
    library = services.library_for(who)
    quizzes = library.list_asking()
    shown: dict[str, Any] = {
        "quizzes": quizzes,
        "scopes": SCOPES,
        "words": WORDS,
        "titles": list_titles(library),
        "regrades": listed,
    }
    return page(request, "regrades.html", status, who=who, trouble=trouble, form=form or {}, **shown)


def parse_wanted(form: dict[str, str]) -> RegradeRequest:
    """Says what the form asks for: a dry run, whose difference is seen before it is applied. Raises Unprocessable."""
    quiz, _, question = form.get("what", "").partition("/")
    chosen, ids = form.get("scope", ""), tuple(re.findall(r"[0-9a-f]{32}", form.get("ids", "")))
    scope: Scope | tuple[str, ...] | None = next((candidate for candidate in SCOPES if candidate == chosen), None)
    if chosen == NAMED:
        scope = ids
    if not scope or len(ids) > IDS_MAX:
        raise Unprocessable(f"Choose which submissions: latest, best, all, or up to {IDS_MAX} ids.")
    return RegradeRequest(quiz, question or None, scope, dry_run=True)
