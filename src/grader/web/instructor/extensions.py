"""`/instructor/extensions`: later dates and further attempts for learners, and the feedback of a quiz. No script."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import RedirectResponse, Response
from pydantic import ValidationError

from grader.courses.answering import publication, results
from grader.courses.answering.policies import read_policies
from grader.courses.people.identity import Identity
from grader.courses.people.namesakes import make_marks, mark_name
from grader.domain.policy import Extension, Policy
from grader.errors import Unprocessable
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.store import extensions, people
from grader.store.tables import ExtensionRow, Member
from grader.web.frame.inputs import Form, Instructor, Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.quiz_choice import choose_quiz
from grader.web.learner.pages import show_sign_in
from grader.web.text.moments import format_day
from grader.web.text.questions import format_count
from grader.web.text.zones import convert_moments

PAGE = "/instructor/extensions"
TICKED = "learner-"
"""What the name of a learner's box begins with; the id follows."""
MOMENTS = {"due": "Due", "until": "Late answers until"}
"""The fields of the form that are moments, with their labels."""
BOXES = 500
"""Learners on the page who can be ticked; all others can be named."""

router = page_router()


@router.get(PAGE)
def show(
    request: Request, services: AppServices, who: Visitor, quiz: Annotated[str, Query(max_length=64)] = ""
) -> Response:
    """The dates of a quiz, and its extensions; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    return render(request, services, who, quiz)


def render(request: Request, services: Services, who: Identity, quiz: str, status: int = 200, **more: Any) -> Response:
    """Renders the page of a quiz, see `choose_quiz`, with the outcome of a form."""
    library = services.library_for(who)
    quizzes = library.list_asking()
    if not quizzes:
        return page(request, "extensions.html", who=who, quizzes=[])
    chosen = choose_quiz(services, who, quizzes, quiz)
    with services.database.read() as session:
        given = [
            {"name": name, "row": row, **describe_dates(row)}
            for row, name in extensions.list_of_quiz(session, who.course, chosen.id)
        ]
        published = extensions.find_published(session, who.course, [chosen.id]).get(chosen.id)
        policy = read_policies(session, library, who.course, [chosen.id])[chosen.id]
        learners, marks = people.list_learners(session, who.course, BOXES + 1), make_marks(session, who.course)
    context: dict[str, Any] = {
        "learners": learners[:BOXES],
        "more_learners": len(learners) > BOXES,
        "marks": marks,
        "quizzes": quizzes,
        "quiz": chosen,
        "policy": policy,
        "dates": describe_policy(policy),
        "given": given,
        "published": published and format_day(published),
        "typed": {},
        "counts_attempts": policy.attempts is not None or any(question.attempts for question in chosen.questions),
    }
    return page(request, "extensions.html", status, who=who, **(context | more))


def describe_dates(granted: Extension | ExtensionRow) -> dict[str, str | None]:
    """Returns the moments of an extension in words."""
    moments = {"due": granted.due, "until": granted.until}
    return {name: None if moment is None else format_day(moment) for name, moment in moments.items()}


def describe_policy(policy: Policy) -> dict[str, str]:
    """Says what the policy of a quiz says of dates and attempts, in words."""
    until = None if policy.late is None else policy.late.until
    moments = {"opens": policy.opens, "due": policy.due, "late until": until}
    dates = {name: format_day(moment) for name, moment in moments.items() if moment is not None}
    return dates | {"attempts": "any number" if policy.attempts is None else str(policy.attempts)}


@router.post(PAGE)
def grant(request: Request, services: AppServices, who: Instructor, form: Form) -> Response:
    """Gives the same extension to learners who are ticked or named, to all or none; tells what each has now. Takes it
    back where the form has `back`. Shows the page again with what was typed if it is refused."""
    quiz = form.get("quiz", "")
    library = services.library_for(who)
    library.quiz(quiz)
    try:
        granted = parse_extension(form)
        if granted == Extension() and "back" not in form:
            raise Unprocessable("Give a date or further attempts. “Take back” below ends an extension.")
        with services.database.write() as session:
            chosen = choose_learners(
                form, people.list_learners(session, who.course), marks := make_marks(session, who.course)
            )
            in_one_order = sorted(chosen, key=lambda learner: learner.id)  # so that two pages never deadlock
            for learner in in_one_order:
                results.grant(services.database, library, session, learner, quiz, granted=granted, by=who)
            names = [mark_name(member.name, member.id, marks) for member in chosen]
            policy = read_policies(session, library, who.course, [quiz])[quiz]
    except Unprocessable as error:
        return render(request, services, who, quiz, 422, trouble=str(error).splitlines(), typed=form)
    done = [f"{name}: {describe_extension(granted)}" for name in names]
    return render(request, services, who, quiz, done=done + explain_early(granted, policy))


def choose_learners(form: Mapping[str, str], learners: Sequence[Member], marks: Mapping[str, str]) -> list[Member]:
    """Returns the learners whom a form ticks (`learner-ID`) or names, each once, by name. Raises Unprocessable where no
    learner is chosen, or with a line for each name that no learner or several bear."""
    named: dict[str, list[Member]] = {}
    for learner in learners:
        for name in {learner.name, mark_name(learner.name, learner.id, marks)}:
            named.setdefault(" ".join(name.split()), []).append(learner)
    wanted = dict.fromkeys(name for line in form.get("names", "").splitlines() if (name := " ".join(line.split())))
    troubles = [explain_refusal(name, len(named.get(name, ()))) for name in wanted if len(named.get(name, ())) != 1]
    ticked = {name.removeprefix(TICKED) for name in form if name.startswith(TICKED)}
    if gone := ticked - {learner.id for learner in learners}:
        troubles.append(f"{len(gone)} of those ticked: no learner of this course any more.")
    ticked |= {member.id for name in wanted for member in named.get(name, ())}
    if not ticked and not troubles:
        troubles = ["Tick or name at least one learner."]
    elif troubles:
        troubles.insert(0, "Nothing was given to anybody.")
    if troubles:
        raise Unprocessable("\n".join(troubles))
    return [learner for learner in learners if learner.id in ticked]


def explain_refusal(name: str, bearers: int) -> str:
    """Says why a typed name is refused."""
    if bearers:
        return f"{name}: {bearers} learners have this name. Add the mark shown after it, or tick the right one."
    return f"{name}: no learner of this course has this name."


def describe_extension(granted: Extension) -> str:
    """Says what a learner has after a form."""
    if granted == Extension():
        return "has no extension any more"
    parts = [
        f"{words} {moment}"
        for words, moment in zip(("due", "late until"), describe_dates(granted).values(), strict=True)
        if moment
    ]
    return ", ".join(parts + ([format_count(granted.attempts, "further attempt")] if granted.attempts else []))


def explain_early(granted: Extension, policy: Policy) -> list[str]:
    """Says which dates of an extension change nothing, since those of the quiz are as late."""
    until = None if policy.late is None else policy.late.until
    dates = {"due": (granted.due, policy.due), "late until": (granted.until, until)}
    return [
        f"{name} {format_day(given)} changes nothing: the quiz itself has {format_day(own)}."
        for name, (given, own) in dates.items()
        if given is not None and own is not None and given <= own
    ]


def parse_extension(form: dict[str, str]) -> Extension:
    """Returns the extension that a form asks for. Raises Unprocessable."""
    typed = convert_moments(form, MOMENTS)
    moments = {name: f"{typed[name]}Z" for name in MOMENTS if typed.get(name)}
    try:
        attempts = int(form.get("attempts") or 0)
        return Extension.model_validate({**moments, "attempts": attempts})
    except ValidationError as error:
        named = ", ".join(sorted({str(detail["loc"][0]) for detail in error.errors() if detail["loc"]}))
        raise Unprocessable(f"Check {named}: dates lie in 2000 to 2199, and further attempts are 0 to 1000.") from error
    except ValueError as error:
        raise Unprocessable("Check attempts: a whole number of 0 to 1000.") from error


@router.post(f"{PAGE}/publication")
def publish(services: AppServices, who: Instructor, form: Form) -> Response:
    """Publishes the feedback of a quiz, or withholds it again. Raises Unauthorized, Forbidden, NotFound."""
    quiz = services.library_for(who).quiz(form.get("quiz", ""))
    with services.database.write() as session:
        if "withhold" in form:
            publication.withdraw(session, who, quiz.id)
        else:
            publication.publish(services.database, session, who, quiz.id)
    return RedirectResponse(f"{PAGE}?quiz={quiz.id}", 303)
