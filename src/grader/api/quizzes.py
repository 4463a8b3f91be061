"""`/quizzes`: what a learner may see, and how far they are; `/content:reload`."""

from typing import Any

from fastapi import APIRouter

from grader.api.context import Anybody, AppContext, Context, Instructor
from grader.api.problems import documented
from grader.domain.quiz import CodeQuestion, PredictQuestion, Quiz
from grader.domain.student_view import lab_view, student_view
from grader.identity import Identity
from grader.store import submissions
from grader.store.submissions import Chosen

router = APIRouter()


@router.get("/quizzes", responses=documented(401, 429))
def list_quizzes(_who: Anybody, context: AppContext) -> dict[str, Any]:
    """Every quiz: its id, title, number of questions and points."""
    return {"items": [summary(quiz) for quiz in context.content.library.quizzes.values()], "next_cursor": None}


@router.get("/quizzes/{quiz_id}", responses=documented(401, 404, 422, 429))
def show_quiz(quiz_id: str, who: Anybody, context: AppContext) -> dict[str, Any]:
    """One quiz with its questions, and how many attempts the learner has used on each."""
    return progress(quiz_id, who, context)


@router.post("/content:reload", responses=documented(401, 403, 422, 429))
def reload_content(_who: Instructor, context: AppContext) -> dict[str, Any]:
    """Loads the content folder again; a faulty one is refused as a whole, with every fault, and the old one stays."""
    context.content.reload()
    library = context.content.library
    return {"quizzes": [{"id": quiz_id, "digest": library.digest(quiz_id)} for quiz_id in library.quizzes]}


def summary(quiz: Quiz) -> dict[str, Any]:
    """A quiz in the list."""
    points = sum(question.points for question in quiz.questions)
    return {"id": quiz.id, "title": quiz.title, "questions": len(quiz.questions), "points": points}


def progress(quiz_id: str, who: Identity, context: Context) -> dict[str, Any]:
    """The student's view of the quiz; the lab of a predict question stands in it once they have answered."""
    library = context.content.library
    quiz = library.quiz(quiz_id)
    with context.database.read() as session:
        used = submissions.attempts_used(session, Chosen(who.course, who.user, quiz.id))
    view = student_view(quiz)
    for question, shown in zip(quiz.questions, view["questions"], strict=True):
        shown["attempts_used"] = used.get(question.id, 0)
        if isinstance(question, CodeQuestion):
            shown["starter"] = library.starter(question)
        if isinstance(question, PredictQuestion) and question.sim and (question.id in used or who.is_instructor):
            shown["lab"] = lab_view(question.sim)
    return view
