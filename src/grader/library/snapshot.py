"""An immutable snapshot of a content folder."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from grader.domain.pages.media import Media
from grader.errors import Fault, NotFound
from grader.questions import Question, Quiz, kind_of

if TYPE_CHECKING:
    from grader.library.lesson_text import LessonText


@dataclass(frozen=True)
class Library:
    """Quizzes by id, texts of lessons by id, pictures and files by path, models (MJCF text) by name, starters (their
    text) by path. `warnings` are remarks for the authors that do not prevent serving. `texts`, by path, are the files
    that exercises name, such as an author's programs. `sources` are, by quiz, the files that its digest is made of, by
    path: `load_files` makes the quiz of them again."""

    root: Path
    quizzes: Mapping[str, Quiz]
    lessons: "Mapping[str, LessonText]" = field(default_factory=dict)
    media: Mapping[str, Media] = field(default_factory=dict, repr=False)
    files: Mapping[str, str] = field(default_factory=dict)
    models: Mapping[str, str] = field(default_factory=dict)
    starters: Mapping[str, str] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    digests: Mapping[str, str] = field(default_factory=dict)
    sources: Mapping[str, Mapping[str, str | bytes]] = field(default_factory=dict, repr=False)
    warnings: tuple[Fault, ...] = ()

    def quiz(self, quiz_id: str) -> Quiz:
        """Returns the quiz of this id. Raises NotFound."""
        try:
            return self.quizzes[quiz_id]
        except KeyError:
            raise NotFound(f"There is no quiz {quiz_id!r}.") from None

    def list_asking(self) -> list[Quiz]:
        """Returns the quizzes that have questions; others have labs alone."""
        return [quiz for quiz in self.quizzes.values() if quiz.questions]

    def question(self, quiz_id: str, question_id: str) -> Question:
        """Returns one question of a quiz. Raises NotFound."""
        return self.find(quiz_id, question_id)[1]

    def find(self, quiz_id: str, question_id: str) -> tuple[Quiz, Question]:
        """Returns a quiz, and one question of it. Raises NotFound."""
        quiz = self.quiz(quiz_id)
        for question in quiz.questions:
            if question.id == question_id:
                return quiz, question
        raise NotFound(f"There is no question {question_id!r} in quiz {quiz_id!r}.")

    def file(self, quiz_id: str) -> str:
        """Returns the path of a quiz file, relative to the root. Raises NotFound."""
        self.quiz(quiz_id)
        return self.files[quiz_id]

    def model_xml(self, name: str) -> str:
        """Returns the MJCF text of models/<name>.xml. Raises NotFound."""
        try:
            return self.models[name]
        except KeyError:
            raise NotFound(f"There is no model {name!r}.") from None

    def find_media(self, sha256: str, name: str) -> Media | None:
        """Returns the picture or file that an address names, if it is of this content."""
        return next((file for file in self.media.values() if file.sha256 == sha256 and file.name == name), None)

    def text(self, path: str) -> str:
        """Returns the text of a file that an exercise names. Raises NotFound."""
        try:
            return self.texts[path]
        except KeyError:
            raise NotFound(f"No exercise names the file {path!r}.") from None

    def starter(self, question: Question) -> str | None:
        """Returns the script that a learner starts from, or None."""
        path = kind_of(question).starter(question)
        return None if path is None else self.starters[path]

    def digest(self, quiz_id: str) -> str:
        """Return the sha256 of all that a verdict depends on: the quiz file, all models, its starters and named files,
        and the pictures that it shows.
        Raises NotFound."""
        self.quiz(quiz_id)
        return self.digests[quiz_id]


def compute_digest(*texts: Mapping[str, str]) -> str:
    """Return the sha256 of named texts in order of name, each preceded by its length."""
    digest = hashlib.sha256()
    for named in texts:
        for name, text in sorted(named.items()):
            for part in (name.encode(), text.encode()):
                digest.update(len(part).to_bytes(8, "big") + part)
    return digest.hexdigest()
