"""What a whole class answered at one question: where every attempt lies, and its mistake, read once for a page."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import lru_cache

from sqlalchemy.orm import Session

from grader.courses.people.identity import Identity
from grader.courses.people.namesakes import make_marks, mark_name
from grader.courses.reviewing.blinding import hide_names
from grader.courses.reviewing.desk import Desk
from grader.courses.rules.mistakes import Family, Mistake, group_mistakes, name_mistake
from grader.courses.rules.positions import choose_placing, merge_axes, read_positions
from grader.domain.axes import ClassAxis, Position
from grader.domain.verdict import Status
from grader.questions import Question, kind_of
from grader.store import results, submissions
from grader.store.engine.database import Database
from grader.store.submissions import SubmissionFilter
from grader.store.tables import Submission

ATTEMPTS_MAX = 3000
"""Attempts that are read, the newest ones: those of a class of 500 at an exercise."""

OPTION = "option-"
"""What begins the key of a mistake that is a choice of options."""

KEPT = 64
"""Questions whose answers are held; those of a class of 30 take some hundred kilobytes."""


@dataclass(frozen=True)
class ClassAttempt:
    """One attempt of a learner. `option` is what was chosen where the question has options."""

    id: str
    learner: str
    name: str
    number: int
    at: datetime
    is_right: bool
    mistake: Mistake | None
    line: int | None
    positions: Mapping[str, Position]
    options: tuple[int, ...] = ()


@dataclass(frozen=True)
class ClassAnswers:
    """The attempts at a question by learner, each learner's in the order of time, and their `axes`."""

    axes: tuple[ClassAxis, ...]
    by_learner: Mapping[str, Sequence[ClassAttempt]]

    @property
    def attempts(self) -> int:
        """How many there are."""
        return sum(map(len, self.by_learner.values()))

    @property
    def solved(self) -> frozenset[str]:
        """The learners with a right attempt."""
        return frozenset(who for who, theirs in self.by_learner.items() if any(attempt.is_right for attempt in theirs))

    @property
    def families(self) -> list[Family]:
        """The mistakes, those of most learners first."""
        return group_mistakes(
            {who: [(attempt.id, attempt.mistake) for attempt in theirs] for who, theirs in self.by_learner.items()}
        )

    def find(self, submission: str) -> ClassAttempt | None:
        """Returns the attempt of this id."""
        return next(
            (attempt for theirs in self.by_learner.values() for attempt in theirs if attempt.id == submission), None
        )


@dataclass(frozen=True)
class Version:
    """What the answers of a class depend on: equal versions have equal answers."""

    course: str
    quiz: str
    question: Question = field(compare=False)
    question_id: str
    digest: str
    """Of the quiz."""
    without: frozenset[str]
    state: results.State


class ClassReader:
    """Reads the answers of a class; those of the last versions are held."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._read = lru_cache(maxsize=KEPT)(self._compute)

    def read_anonymous(self, session: Session, course: str, quiz: tuple[str, str], question: Question) -> ClassAnswers:
        """Returns the answers of a class as the verdicts stand, with ids in place of names. `quiz` is its id and its
        digest."""
        without = frozenset(results.list_instructors(session, course))
        state = results.read_state(session, course, [quiz[0]])
        return self._read(Version(course, quiz[0], question, question.id, quiz[1], without, state))

    def read_for(self, desk: Desk, session: Session, who: Identity, quiz: str, question: Question) -> ClassAnswers:
        """Returns the answers as an instructor may see them: with pseudonyms where marking is blind, and without first
        marks that are not to be seen yet."""
        without = results.list_instructors(session, who.course)
        wanted = SubmissionFilter(who.course, quiz=quiz, question=question.id)
        rows = submissions.list_graded(session, wanted, without, ATTEMPTS_MAX)
        verdicts = {row.id: json.loads(body) for row, body in rows}
        seen = hide_names(desk, session, who, [row for row, _ in rows], verdicts)
        marks = make_marks(session, who.course)
        named = {row.id: seen.names.get(row.id) or mark_name(row.user, row.learner, marks) for row, _ in rows}
        answers = name_choices(build_answers([(row, seen.verdicts[row.id]) for row, _ in rows], question), question)
        by_learner = {
            learner: [replace(attempt, name=named[attempt.id]) for attempt in theirs]
            for learner, theirs in answers.by_learner.items()
        }
        return replace(answers, by_learner=by_learner)

    def _compute(self, version: Version) -> ClassAnswers:
        with self._database.read() as session:
            wanted = SubmissionFilter(version.course, quiz=version.quiz, question=version.question_id)
            rows = submissions.list_graded(session, wanted, version.without, ATTEMPTS_MAX)
            answers = build_answers([(row, json.loads(body)) for row, body in rows], version.question)
            return name_choices(answers, version.question)


def name_choices(answers: ClassAnswers, question: Question) -> ClassAnswers:
    """Names wrong attempts that have no diagnosis by the options that were chosen, where the question has options."""
    texts = [option.text for option in kind_of(question).options(question)]
    if not texts:
        return answers

    def name(attempt: ClassAttempt) -> ClassAttempt:
        chosen, mistake = sorted(attempt.options), attempt.mistake
        if mistake is None or mistake.sentence or not chosen or chosen[-1] >= len(texts):
            return attempt
        key = OPTION + "-".join(map(str, chosen))
        return replace(attempt, mistake=Mistake(key, "Chose: " + "; ".join(texts[place] for place in chosen), ""))

    return replace(answers, by_learner={who: [*map(name, theirs)] for who, theirs in answers.by_learner.items()})


def build_answers(rows: Sequence[tuple[Submission, Mapping[str, object]]], question: Question) -> ClassAnswers:
    """Returns the answers of these submissions, whose verdicts are plain JSON. Names are left out."""
    place = choose_placing(question)
    placed = [list(place(verdict)) for _, verdict in rows]
    axes = merge_axes([axis for axis, _ in pairs] for pairs in placed)
    by_learner: dict[str, list[ClassAttempt]] = {}
    for (row, verdict), one in zip(rows, placed, strict=True):
        by_learner.setdefault(row.learner, []).append(build_attempt(row, verdict, read_positions(one)))
    return ClassAnswers(tuple(axes), by_learner)


def build_attempt(row: Submission, verdict: Mapping[str, object], positions: Mapping[str, Position]) -> ClassAttempt:
    """Returns one attempt."""
    status, diagnosis, line = (verdict.get(name) for name in ("status", "diagnosis", "line"))
    evidence = verdict.get("evidence")
    option = evidence.get("option") if isinstance(evidence, dict) else None
    chosen = tuple(index for index in (option if isinstance(option, list) else [option]) if isinstance(index, int))
    return ClassAttempt(
        row.id, row.learner, "", row.attempt, row.created_at, status == Status.CORRECT,
        name_mistake(str(status), diagnosis if isinstance(diagnosis, str) else None),
        line if isinstance(line, int) else None, positions, chosen,
    )  # fmt: skip
