"""`/quizzes`: the quizzes as a learner may see them, with the learner's progress; `/content:reload`."""

from typing import Any

from fastapi import APIRouter

from grader.api.context import Anybody, AppContext, Context, Instructor
from grader.api.paging import Page
from grader.api.problems import documented
from grader.api.views import LoadedContent, QuizSummary, QuizView
from grader.courses.audit import Action, record
from grader.courses.standing import progress_in, standing_of
from grader.domain.quiz import CodeQuestion, PredictQuestion, Quiz
from grader.domain.student_view import lab_view, student_view, unopened_view
from grader.identity import Identity

router = APIRouter()


@router.get("/quizzes", response_model=Page[QuizSummary], responses=documented(401, 429))
def list_quizzes(who: Anybody, context: AppContext) -> dict[str, Any]:
    """Lists every quiz: its id, title, number of questions and points, and when it may be answered."""
    return {
        "items": [summary(quiz) for quiz in context.content.of(who.course).library.quizzes.values()],
        "next_cursor": None,
    }


@router.get("/quizzes/{quiz_id}", responses=documented(401, 404, 422, 429, more={200: {"model": QuizView}}))
def show_quiz(quiz_id: str, who: Anybody, context: AppContext) -> dict[str, Any]:
    """Shows one quiz with its questions, how many attempts the learner has used on each, and what counts.

    Before the quiz opens a learner sees no questions.
    """
    return progress(quiz_id, who, context)


@router.post("/content:reload", response_model=LoadedContent, responses=documented(401, 403, 422, 429))
def reload_content(who: Instructor, context: AppContext) -> dict[str, Any]:
    """Loads the content folder again. With any fault, lists all of them and keeps what was loaded before."""
    context.content.of(who.course).reload()
    library = context.content.of(who.course).library
    with context.database.write() as session:
        digests = {quiz_id: library.digest(quiz_id) for quiz_id in library.quizzes}
        record(session, who, who.course, Action.CONTENT_RELOADED, **digests)
    return {"quizzes": [{"id": quiz_id, "digest": library.digest(quiz_id)} for quiz_id in library.quizzes]}


def summary(quiz: Quiz) -> dict[str, Any]:
    """A quiz as an item of the list."""
    points = sum(question.points for question in quiz.questions)
    dates = {"opens": quiz.policy.opens, "due": quiz.policy.due}
    return {"id": quiz.id, "title": quiz.title, "questions": len(quiz.questions), "points": points, **dates}


def progress(quiz_id: str, who: Identity, context: Context) -> dict[str, Any]:
    """The student's view of a quiz. It holds the lab of a predict question once the learner may run it."""
    library = context.content.of(who.course).library
    quiz = library.quiz(quiz_id)
    with context.database.read() as session:
        standing = standing_of(session, library, who)
        reached = progress_in(session, standing, who, quiz)
    if not standing.has_opened(quiz_id):
        return unopened_view(quiz)
    view = student_view(quiz)
    for question, shown in zip(quiz.questions, view["questions"], strict=True):
        shown.update(reached[question.id])
        if isinstance(question, CodeQuestion):
            shown["starter"] = library.starter(question)
        may_run = standing.decision(quiz_id, question.id).why_no_lab is None
        if isinstance(question, PredictQuestion) and question.sim and may_run:
            shown["lab"] = lab_view(question.sim)
    return view
