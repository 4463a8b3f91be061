"""`/instructor/alike`: scripts that look alike, for instructors alone. It needs no script."""

from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import Response

from grader.courses.people.identity import Identity
from grader.courses.reporting.alike import AlikeAt, compare_scripts, list_exercises
from grader.errors import NotFound
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices, Services
from grader.questions import Question
from grader.web.frame.inputs import Visitor
from grader.web.frame.rendering import page
from grader.web.instructor.reviewing.review_list import PAGE as REVIEW
from grader.web.learner.pages import show_sign_in
from grader.web.text.questions import list_titles

PAGE = "/instructor/alike"

router = page_router()

Id = Annotated[str, Query(pattern="^[0-9a-f]{0,32}$")]


@dataclass(frozen=True)
class Side:
    """One of two scripts: whose it is, and its lines, each with whether the other has it too."""

    name: str
    address: str
    lines: tuple[tuple[str, bool], ...]


@router.get(PAGE)
def show_alike(
    request: Request, services: AppServices, who: Visitor, *, what: Annotated[str, Query(max_length=200)] = "",
    one: Id = "", other: Id = "",
) -> Response:  # fmt: skip
    """Groups of scripts at an exercise, or two side by side; anyone but an instructor is told to sign in.

    `what` is the quiz and the exercise, with a slash between. Raises NotFound."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    exercises = list_exercises(services.library_for(who))
    titles = list_titles(services.library_for(who))
    context: dict[str, Any] = {
        "exercises": [(f"{quiz}/{asked.id}", titles[quiz, asked.id]) for quiz, asked in exercises],
        "what": what,
        "alike": None,
        "sides": (),
        "others": (),
    }
    if exercises:
        alike = compare(services, who, choose_exercise(exercises, what))
        context |= {"alike": alike, "what": f"{alike.quiz}/{alike.question}"}
        if one or other:
            context |= {"sides": make_sides(alike, one, other), "one": one, "other": other}
            context["others"] = list_others(alike, one)
    return page(request, "alike.html", who=who, **context)


def choose_exercise(exercises: list[tuple[str, Question]], what: str) -> tuple[str, Question]:
    """Returns the exercise of this name, the first without one. Raises NotFound."""
    for quiz, question in exercises:
        if what in ("", f"{quiz}/{question.id}"):
            return quiz, question
    raise NotFound("There is no such exercise.")


def compare(services: Services, who: Identity, at: tuple[str, Question]) -> AlikeAt:
    """Compares the scripts at an exercise."""
    with services.database.read() as session:
        return compare_scripts(services.classes, services.desk_of(who.course), session, who, at)


def make_sides(alike: AlikeAt, one: str, other: str) -> tuple[Side, Side]:
    """Returns two scripts side by side. Raises NotFound where they are none of these."""
    if one not in alike.fingerprints or other not in alike.fingerprints:
        raise NotFound("One of the two has handed in another script meanwhile.")
    return make_side(alike, one, other), make_side(alike, other, one)


def list_others(alike: AlikeAt, one: str) -> list[str]:
    """Returns the other scripts of the group of a script; none where it is in no group."""
    group = next((group for group in alike.groups if one in group.closest), None)
    return [] if group is None else [each for each in group.closest if each != one]


def make_side(alike: AlikeAt, one: str, other: str) -> Side:
    """Returns one of two scripts."""
    marked = alike.mark(one, other)
    lines = tuple((line, number in marked) for number, line in enumerate(alike.sources[one].splitlines(), 1))
    return Side(alike.names[one], f"{REVIEW}/{one}?which=submissions", lines)
