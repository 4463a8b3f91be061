"""`/quizzes/{quiz}/{question}/class`: where the class stands, for a learner who has solved the question. It names
nobody, and shows nothing where too few have answered to hide among. It needs no script."""

from collections import Counter
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import Response

from grader.courses.answering.access import read_access
from grader.courses.reporting.class_answers import ClassAnswers
from grader.courses.rules.policy import Visibility
from grader.domain.axes import ClassAxis, Position
from grader.errors import Conflict
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.web.cohort.axis_plot import draw_class, list_dots
from grader.web.cohort.axis_words import describe_near, round_position
from grader.web.frame.inputs import Visitor
from grader.web.frame.rendering import page
from grader.web.learner.pages import show_sign_in
from grader.web.text.questions import list_titles

LEARNERS_MIN = 8
"""Learners with a claim on an axis before it is shown to learners."""
PILE_MIN = 3
"""Learners of a pile that is named."""

NOT_SOLVED = "You see where the class stands once you have solved the question, and its solution may be seen."

router = page_router()


@router.get("/quizzes/{quiz_id}/{question_id}/class")
def show_to_learner(
    request: Request, services: AppServices, who: Visitor, quiz_id: str, question_id: str, *,
    axis: Annotated[str, Query(max_length=200)] = "",
) -> Response:  # fmt: skip
    """The class without names. Raises NotFound; Conflict before the learner has solved the question."""
    if who is None:
        return show_sign_in(request, services, who)
    library = services.library_for(who)
    asked = library.question(quiz_id, question_id)
    with services.database.read() as session:
        access = read_access(session, library, who, (quiz_id, question_id))
        if (
            access.decide(quiz_id, question_id).shown is not Visibility.SOLUTION
            or not access.progress_at(quiz_id, question_id).solved
        ):
            raise Conflict(NOT_SOLVED)
        answers = services.classes.read_anonymous(session, who.course, (quiz_id, library.digest(quiz_id)), asked)
    drawn = {candidate.id: len(list_dots(answers, candidate)) for candidate in answers.axes}
    axes = [candidate for candidate in answers.axes if drawn[candidate.id] >= LEARNERS_MIN]
    chosen = next((candidate for candidate in axes if candidate.id == axis), None) or next(
        (candidate for candidate in axes if candidate.right), None
    )
    context: dict[str, Any] = {
        "title": list_titles(library)[quiz_id, question_id],
        "path": f"/quizzes/{quiz_id}/{question_id}",
        "axes": axes,
        "axis": "" if chosen is None else chosen.id,
        "near": "" if chosen is None or chosen.right is None else describe_near(chosen),
        "plot": None if chosen is None else draw_class(answers, chosen, own=who.id, named_from=PILE_MIN),
        "rows": [] if chosen is None else count_positions(answers, chosen),
        "solved": len(answers.solved),
        "learners": len(answers.by_learner),
        "drawn": max(drawn.values(), default=0),
        "least": LEARNERS_MIN,
    }
    return page(request, "class_learner.html", who=who, **context)


def count_positions(answers: ClassAnswers, axis: ClassAxis) -> list[tuple[str, int]]:
    """Returns the claims on an axis to two figures, with how many learners made each, the commonest first."""
    counts = Counter(describe_position(dot.position, axis) for dot in list_dots(answers, axis))
    return sorted(counts.items(), key=lambda count: (-count[1], count[0]))


def describe_position(position: Position, axis: ClassAxis) -> str:
    """Returns the middle of a position to two figures, in words."""
    return round_position(position, 2, axis) if position.is_none else f"about {round_position(position, 2, axis)}"
