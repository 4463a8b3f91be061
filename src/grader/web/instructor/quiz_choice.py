"""The quiz that an instructor's page is about."""

from collections.abc import Sequence

from grader.courses.people.identity import Identity
from grader.gate.services import Services
from grader.questions import Quiz
from grader.store import submissions


def choose_quiz(services: Services, who: Identity, quizzes: Sequence[Quiz], wanted: str) -> Quiz:
    """Returns the quiz of this id; without one that of `quizzes` to which the newest submission belongs, else the first
    of them. Raises NotFound."""
    if wanted:
        return services.library_for(who).quiz(wanted)
    with services.database.read() as session:
        newest = submissions.find_newest_quiz(session, who.course)
    return next((quiz for quiz in quizzes if quiz.id == newest), quizzes[0])
