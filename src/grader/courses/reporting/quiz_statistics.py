"""The statistics of a quiz from its stored results, for the API and for pages."""

from dataclasses import dataclass, field
from functools import lru_cache

from grader.courses.people.identity import Identity
from grader.courses.reviewing.blinding import find_unseen
from grader.courses.rules.statistics import QuestionStatistics, compute_statistics, count_learners, tally_answers
from grader.library import Library
from grader.questions import Quiz, kind_of
from grader.store import results
from grader.store.engine.database import Database
from grader.store.results import State

VERSIONS_MAX = 256
"""Statistics that are cached; those of a quiz are a few kilobytes."""


@dataclass(frozen=True)
class QuizStatistics:
    """The questions of a quiz that have answers, in the order of the quiz, and the number of learners."""

    learners: int
    questions: tuple[QuestionStatistics, ...]


@dataclass(frozen=True)
class Version:
    """What the statistics of a quiz depend on: equal versions have equal statistics. They are about all learners but
    `without`, who are instructors that try questions, and leave out the `hidden` pairs of learner and question, whose
    marks the reader must not see yet."""

    course: str
    quiz: Quiz = field(compare=False)
    digest: str
    """Of the quiz."""
    without: frozenset[str]
    hidden: frozenset[tuple[str, str]]
    state: State

    @property
    def parts(self) -> tuple[object, ...]:
        """The version as values that are the same in every process: sets have no order."""
        return self.course, self.digest, sorted(self.without), sorted(self.hidden), self.state


class Statistics:
    """Computes the statistics of quizzes; those of the last versions are cached."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self.compute = lru_cache(maxsize=VERSIONS_MAX)(self._compute)
        """Returns the statistics of a version, read in a transaction of its own."""

    def version(self, library: Library, quiz_id: str, who: Identity) -> Version:
        """Reads the current version of what this instructor may see. Raises NotFound for an unknown quiz."""
        quiz, digest = library.quiz(quiz_id), library.digest(quiz_id)
        with self._database.read() as session:
            without = frozenset(results.list_instructors(session, who.course))
            unseen = find_unseen(session, who).results
            state = results.read_state(session, who.course, [quiz_id])
        hidden = frozenset(
            (place.learner, place.question) for place in unseen if (place.course, place.quiz) == (who.course, quiz_id)
        )
        return Version(who.course, quiz, digest, without, hidden, state)

    def _compute(self, version: Version) -> QuizStatistics:
        quiz = version.quiz
        tolerances = {
            question.id: [number.tolerance for number in kind_of(question).numbers(question)]
            for question in quiz.questions
        }
        without, hidden = version.without, version.hidden
        with self._database.read() as session:
            visible = (
                [row for row in rows if row[0] not in without and (not hidden or row[:2] not in hidden)]
                for rows in results.iterate_of_quiz(session, version.course, quiz.id)
            )
            by_question = tally_answers(visible, tolerances)
        tallies = [by_question[question.id] for question in quiz.questions if question.id in by_question]
        return QuizStatistics(count_learners(tallies), compute_statistics(tallies))
