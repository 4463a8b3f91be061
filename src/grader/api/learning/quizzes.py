"""`/quizzes`: the quizzes as a learner may see them, with the learner's progress; `/content:reload`."""

from typing import Any

from grader.api.paging import Cut, Page
from grader.api.views import LoadedContent, QuizSummary, QuizView
from grader.courses.answering.access import describe_progress, read_access
from grader.courses.answering.policies import read_policies
from grader.courses.people.identity import Identity
from grader.domain.policy import Policy
from grader.gate.callers import Anybody, Instructor, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices, Services
from grader.questions import Quiz, kind_of, lab_view, student_view, unopened_view

router = api_router("quizzes")


@router.get("/quizzes", response_model=Page[QuizSummary], responses=refusals(401, 422, 429))
def list_quizzes(who: Anybody, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists every quiz: its id, title, number of questions and points, and when it may be answered."""
    library = services.content.get(who.course).library
    with services.database.read() as session:
        policies = read_policies(session, library, who.course, library.quizzes)
    return cut([summarise_quiz(library.quiz(quiz_id), policy) for quiz_id, policy in policies.items()])


@router.get("/quizzes/{quiz_id}", responses=refusals(401, 404, 422, 429, more={200: {"model": QuizView}}))
def show_quiz(quiz_id: str, who: Anybody, services: AppServices) -> dict[str, Any]:
    """Shows one quiz with its questions, how many attempts the learner has used on each, and what counts.

    Before the quiz opens a learner sees no questions.
    """
    return view_quiz(quiz_id, who, services)


@router.post("/content:reload", response_model=LoadedContent, responses=refusals(401, 403, 422, 429))
def reload_content(who: Instructor, services: AppServices) -> dict[str, Any]:
    """Loads the content folder again. With any fault, lists all of them and keeps what was loaded before."""
    library = services.reload_content(who)
    return {"quizzes": [{"id": quiz_id, "digest": library.digest(quiz_id)} for quiz_id in library.quizzes]}


def summarise_quiz(quiz: Quiz, policy: Policy) -> dict[str, Any]:
    """A quiz as an item of the list."""
    points = sum(question.points for question in quiz.questions)
    dates = {"opens": policy.opens, "due": policy.due}
    return {"id": quiz.id, "title": quiz.title, "questions": len(quiz.questions), "points": points, **dates}


def view_quiz(quiz_id: str, who: Identity, services: Services) -> dict[str, Any]:
    """The student's view of a quiz. It holds the lab of a predict question once the learner may run it."""
    library = services.library_for(who)
    quiz = library.quiz(quiz_id)
    with services.database.read() as session:
        access = read_access(session, library, who)
        reached = describe_progress(session, access, who, quiz)
    if not access.has_opened(quiz_id):
        return unopened_view(quiz, access.policies[quiz_id])
    view = student_view(quiz, access.policies[quiz_id])
    for question, shown in zip(quiz.questions, view["questions"], strict=True):
        shown.update(reached[question.id])
        kind = kind_of(question)
        if kind.is_script:
            shown["starter"] = library.starter(question)
        lab = kind.lab(question)
        if lab is not None and access.decide(quiz_id, question.id).why_no_lab is None:
            shown["lab"] = lab_view(lab)
    return view
