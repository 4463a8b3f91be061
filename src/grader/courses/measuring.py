"""The statistics of a quiz from its stored results, for the API and for pages."""

from collections.abc import Set
from dataclasses import dataclass, field

from sqlalchemy.orm import Session

from grader.courses.blinding import unseen_by
from grader.courses.kept import Kept, Parts
from grader.courses.statistics import QuestionStatistics, Tally, learners_of, statistics_of, tallies_of
from grader.domain.quiz import NumericQuestion, Quiz
from grader.identity import Identity
from grader.library import Library
from grader.store import results
from grader.store.results import State

QUIZZES_KEPT = 256
"""Statistics that are kept; those of a quiz are a few kilobytes."""

TALLIES_KEPT = 16
"""Quizzes whose points are kept: about a megabyte for 5,000 learners and 8 questions."""


@dataclass(frozen=True)
class QuizStatistics:
    """The questions of a quiz that have answers, in the order of the quiz, and the number of learners."""

    learners: int
    questions: tuple[QuestionStatistics, ...]


@dataclass(frozen=True)
class Seen:
    """Whose results of a quiz an instructor sees: of all learners but `without`, and without `hidden` ones.

    `without` are instructors who try questions; `hidden` are pairs of learner and question.
    """

    course: str
    quiz: str
    digest: str
    """Of the quiz."""
    without: frozenset[str]
    hidden: frozenset[tuple[str, str]]


@dataclass(frozen=True)
class Version:
    """What the statistics of a quiz depend on."""

    seen: Seen
    state: State

    @property
    def parts(self) -> tuple[object, ...]:
        """The same in every process: sets have no order."""
        seen = self.seen
        return seen.course, seen.digest, sorted(seen.without), sorted(seen.hidden), self.state


@dataclass(frozen=True)
class Statistics:
    """Makes statistics, and keeps them: after a change, only the changed questions are read and counted again."""

    _whole: Kept[Version, QuizStatistics] = field(default_factory=lambda: Kept(QUIZZES_KEPT))
    _tallies: Parts[Seen, str, Tally] = field(default_factory=lambda: Parts(TALLIES_KEPT))

    def version(self, session: Session, library: Library, quiz: str, who: Identity) -> Version:
        """What the statistics depend on that this instructor may see. Raises NotFound for an unknown quiz."""
        digest, without = library.digest(quiz), frozenset(results.instructors(session, who.course))
        unseen = unseen_by(session, who).results
        hidden = frozenset(
            (one.learner, one.question) for one in unseen if (one.course, one.quiz) == (who.course, quiz)
        )
        state = results.state(session, who.course, [quiz])
        return Version(Seen(who.course, quiz, digest, without, hidden), state)

    def of(self, session: Session, quiz: Quiz, version: Version) -> QuizStatistics:
        """The statistics of a quiz in this version."""
        return self._whole.get(version, lambda: self._measured(session, quiz, version.seen))

    def _measured(self, session: Session, quiz: Quiz, seen: Seen) -> QuizStatistics:
        states = results.states_of_questions(session, seen.course, quiz.id)
        tolerances = {one.id: one.tolerance for one in quiz.questions if isinstance(one, NumericQuestion)}

        def tallied(changed: Set[str]) -> dict[str, Tally]:
            found = results.of_questions(session, seen.course, quiz.id, changed)
            rows = (row for row in found if row[0] not in seen.without and row[:2] not in seen.hidden)
            return tallies_of(rows, tolerances)

        present = {one.id: states[one.id] for one in quiz.questions if one.id in states}
        tallies = list(self._tallies.get(seen, present, tallied).values())
        return QuizStatistics(len(learners_of(tallies)), statistics_of(tallies))
