"""`/instructor/learners/{id}`: a learner's whole story. No script."""

from collections.abc import Collection, Mapping, Sequence
from itertools import groupby
from typing import Annotated, Any

from fastapi import Query, Request
from fastapi.responses import Response

from grader.courses.people.identity import Identity, Role
from grader.courses.people.namesakes import make_marks
from grader.courses.reviewing.blinding import find_unseen, hide_names
from grader.errors import NotFound
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.library import Library
from grader.questions import Question, show_answer
from grader.store import people, results, submissions
from grader.store.submissions import SubmissionFilter
from grader.web.frame.inputs import Instructor
from grader.web.frame.rendering import page
from grader.web.instructor.gradebook import EMPTY, ResultCell, is_in, make_cell
from grader.web.instructor.people import describe_origin, describe_return
from grader.web.text.lessons import group_lessons
from grader.web.text.questions import list_titles
from grader.web.text.statuses import REPLACED, Badge
from grader.web.verdict.work import GivenAnswer, read_in_full

ANSWERS = 100
"""Answers of a learner's story on one page."""

router = page_router()


@router.get("/instructor/learners/{learner}")
def story(
    request: Request, learner: str, services: AppServices, who: Instructor, *,
    before: Annotated[str, Query(max_length=32)] = "",
) -> Response:  # fmt: skip
    """Every answer of a learner with its verdict, by question; of those under review without a name, how many. Raises
    Unauthorized, Forbidden, NotFound."""
    desk = services.desk_of(who.course)
    with services.database.read() as session:
        wanted = SubmissionFilter(who.course, learner=learner)
        rows = submissions.page(session, wanted, before or None, ANSWERS + 1)
        known = people.find(session, learner, who.course)
        member = None if known is None or known.removed_at is not None else known
        if known is None and not rows:
            raise NotFound("There is no such learner.")
        averaged = desk.list_averaged(session, who.course)
        seen = hide_names(desk, session, who, rows, submissions.read_verdicts(session, rows))
        counts = results.find_everywhere(session, who.course, learner)
        right = results.find_right_but_late(session, who.course, [learner], averaged)
        unseen = find_unseen(session, who).results
        read = services.answers_in(services.library_for(Identity(learner, "", Role.STUDENT, who.course)))
        shown = [(row, read_in_full(row, read(row), seen.verdicts.get(row.id))) for row in rows[:ANSWERS]]
        marks = make_marks(session, who.course)
    given = [(row.quiz, row.question, None if row.id in seen.names else attempt) for row, attempt in shown]
    cells = {at: make_cell(result, unseen, right) for at, result in counts.items()}
    name = known.name if known is not None else rows[0].user
    posed = services.library_for(Identity(learner, "", Role.STUDENT, who.course))
    parts = group_answers(posed, given, cells, averaged)
    following = rows[ANSWERS - 1].id if len(rows) > ANSWERS else None
    asked = {(quiz.id, question.id) for quiz in posed.quizzes.values() for question in quiz.questions}
    counted = [
        result for at, result in counts.items()
        if at in asked and not is_in(unseen, result) and (result.is_final or result.points)
    ]  # fmt: skip
    total = (sum(result.points for result in counted), sum(result.max_points for result in counted))
    return page(
        request, "learner.html", who=who, learner=learner, name=name, parts=parts, following=following,
        total=total, member=member, origin="" if member is None else describe_origin(member), marks=marks,
        lessons=group_lessons(desk.library),
        way_back="" if known is None or member is not None else describe_return(known),
    )  # fmt: skip


def group_answers(
    library: Library, given: Sequence[tuple[str, str, GivenAnswer | None]], cells: Mapping[tuple[str, str], ResultCell],
    averaged: Collection[str],
) -> list[dict[str, Any]]:  # fmt: skip
    """Returns the answers by question, in the order of the content; questions that it has lost come last. None stands
    for an answer that bears a pseudonym for its reviewers. In the quizzes `averaged` all attempts count."""
    titles = list_titles(library)
    questions = {(quiz.id, question.id): question for quiz in library.quizzes.values() for question in quiz.questions}
    places = {at: place for place, at in enumerate(questions)}

    def place(entry: tuple[str, str, GivenAnswer | None]) -> tuple[int, str, str]:
        return places.get(entry[:2], len(places)), entry[0], entry[1]

    return [
        {
            "quiz": at[1],
            "question": at[2],
            "title": titles.get((at[1], at[2]), at[2]),
            "is_lost": at[1:] not in questions,
            "cell": cells.get((at[1], at[2]), EMPTY),
            "answers": [
                (
                    answer,
                    write_answer(questions.get((at[1], at[2])), answer),
                    describe_state(answer, waits=place == 0 or at[1] in averaged),
                )
                for place, answer in enumerate(answers)
                if answer is not None
            ],
            "blind": answers.count(None),
        }
        for at, theirs in groupby(sorted(given, key=place), key=place)
        for answers in [[answer for _, _, answer in theirs]]
    ]


def write_answer(question: Question | None, given: GivenAnswer) -> str:
    """Returns an answer in words; as it was typed where the content has lost the question."""
    return given.text if question is None else show_answer(question, given.answer)


def describe_state(given: GivenAnswer, *, waits: bool) -> Badge:
    """Returns the state of an answer: an earlier one no longer `waits` for a person, unless all attempts count."""
    return given.badge if waits or given.is_decided or given.verdict is None else REPLACED
