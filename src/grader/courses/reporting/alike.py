"""The scripts of a course that look alike, at each exercise: for instructors alone. A hint to read two scripts, never a
finding: short exercises have few ways to be written."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from sqlalchemy.orm import Session

from grader.courses.people.identity import Identity
from grader.courses.reporting.class_answers import ClassReader
from grader.courses.reviewing.desk import Desk
from grader.courses.rules.similarity import Fingerprints, Group, find_alike, hash_given, mark_lines, take_fingerprints
from grader.domain.run import SOURCE_BYTES_MAX
from grader.library import Library
from grader.library.files import list_files, read_text
from grader.questions import Question, question_view
from grader.store import submissions

SCRIPTS_MAX = 1000
"""Scripts that are compared at an exercise, the newest ones, one a learner."""


@dataclass(frozen=True)
class AlikeAt:
    """What looks alike at an exercise; `names` and `sources` are those of the scripts, by the id of the submission."""

    quiz: str
    question: str
    compared: int
    groups: tuple[Group, ...]
    names: Mapping[str, str]
    sources: Mapping[str, str]
    fingerprints: Mapping[str, Fingerprints]

    def mark(self, one: str, other: str) -> set[int]:
        """Returns the lines of a script that it shares with another."""
        return mark_lines(self.fingerprints[one], self.fingerprints[other])


def compare_scripts(
    reader: ClassReader, desk: Desk, session: Session, who: Identity, at: tuple[str, Question]
) -> AlikeAt:
    """Compares the newest script of every learner at an exercise."""
    quiz, question = at
    answers = reader.read_for(desk, session, who, quiz, question)
    last = sorted((theirs[-1] for theirs in answers.by_learner.values()), key=lambda attempt: attempt.id)
    newest = last[-SCRIPTS_MAX:]
    names = {attempt.id: attempt.name for attempt in newest}
    sources = {row.id: read_source(row.answer) for row in submissions.get_several(session, list(names))}
    given = hash_given(list_given(desk.library, quiz, question))
    fingerprints = {script_id: take_fingerprints(source, given) for script_id, source in sources.items() if source}
    groups = tuple(find_alike(fingerprints))
    return AlikeAt(quiz, question.id, len(fingerprints), groups, names, sources, fingerprints)


def list_exercises(library: Library) -> list[tuple[str, Question]]:
    """Returns the exercises of the content that take scripts, with their quizzes: two right models are alike, and files
    have no lines."""
    quizzes = library.quizzes.values()
    return [
        (quiz.id, question)
        for quiz in quizzes
        for question in quiz.questions
        if question_view(question).get("takes") == "python"
    ]


def list_given(library: Library, quiz: str, question: Question) -> Iterator[str]:
    """Yields what every learner may have: the starter, and the content's right programs."""
    if starter := library.starter(question):
        yield starter
    for file in list_files(library.root, "reference_solutions", f"{quiz}/{question.id}/correct__*.py"):
        source = read_text(library.root, file, SOURCE_BYTES_MAX)
        if isinstance(source, str):
            yield source


def read_source(answer: str) -> str:
    """Returns the script of a stored answer; empty where it was erased, or is none."""
    given = json.loads(answer) if answer else None
    return str(given.get("source", "")) if isinstance(given, dict) else ""
