"""An immutable snapshot of a content folder."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from grader.domain.quiz import CodeQuestion, Question, Quiz
from grader.errors import Fault, NotFound


@dataclass(frozen=True)
class Library:
    """Quizzes by id, models (MJCF text) by name, starters (Python text) by path; `warnings` are not yet faults."""

    root: Path
    quizzes: Mapping[str, Quiz]
    files: Mapping[str, str] = field(default_factory=dict)
    models: Mapping[str, str] = field(default_factory=dict)
    starters: Mapping[str, str] = field(default_factory=dict)
    digests: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[Fault, ...] = ()

    def quiz(self, quiz_id: str) -> Quiz:
        """Raises NotFound."""
        try:
            return self.quizzes[quiz_id]
        except KeyError:
            raise NotFound(f"There is no quiz {quiz_id!r}.") from None

    def question(self, quiz_id: str, question_id: str) -> Question:
        """Raises NotFound."""
        for question in self.quiz(quiz_id).questions:
            if question.id == question_id:
                return question
        raise NotFound(f"There is no question {question_id!r} in quiz {quiz_id!r}.")

    def file(self, quiz_id: str) -> str:
        """Where a quiz stands, relative to the root. Raises NotFound."""
        self.quiz(quiz_id)
        return self.files[quiz_id]

    def model_xml(self, name: str) -> str:
        """The MJCF text of models/<name>.xml. Raises NotFound."""
        try:
            return self.models[name]
        except KeyError:
            raise NotFound(f"There is no model {name!r}.") from None

    def starter(self, question: Question) -> str | None:
        """The script that a learner starts from, if the question has one."""
        if not isinstance(question, CodeQuestion) or question.starter is None:
            return None
        return self.starters[question.starter]

    def digest(self, quiz_id: str) -> str:
        """sha256 of everything that a verdict on this quiz depends on: its file, all models, its starters.

        Raises NotFound.
        """
        self.quiz(quiz_id)
        return self.digests[quiz_id]


def digest_of(*texts: Mapping[str, str]) -> str:
    """sha256 over named texts, in order of name; lengths keep one from flowing into the next."""
    digest = hashlib.sha256()
    for named in texts:
        for name, text in sorted(named.items()):
            for part in (name.encode(), text.encode()):
                digest.update(len(part).to_bytes(8, "big") + part)
    return digest.hexdigest()
