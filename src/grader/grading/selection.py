"""Selection: the part of a content folder that is checked."""

from dataclasses import dataclass

from grader.errors import Fault
from grader.library import Library
from grader.library.quiz_files import list_quiz_files, outline_quiz


@dataclass(frozen=True)
class Selection:
    """One quiz, one question of it, or everything."""

    quiz: str | None = None
    question: str | None = None

    @classmethod
    def parse(cls, text: str | None) -> "Selection":
        """Reads QUIZ or QUIZ/QUESTION."""
        quiz, _, question = (text or "").partition("/")
        return cls(quiz or None, question or None)

    def has(self, quiz: str, question: str | None = None) -> bool:
        """Whether a question, or something of the quiz itself, is checked."""
        return self.quiz in (None, quiz) and (question is None or self.question in (None, question))

    def find_fault(self, library: Library) -> Fault | None:
        """Returns a fault where the content has no such quiz or question."""
        quiz = library.quizzes.get(self.quiz or "")
        if self.quiz is not None and quiz is None:  # the library holds the chosen quiz alone
            outlines = (outline_quiz(library.root, file) for file in list_quiz_files(library.root))
            quizzes = [outline[0] for outline in outlines if outline is not None]
        else:
            quizzes = [*library.quizzes]
        questions = () if quiz is None else quiz.questions
        for name, known in ((self.quiz, quizzes), (self.question, [question.id for question in questions])):
            if name is not None and name not in known:
                return Fault("--only", name, f"is not there: take one of {', '.join(known) or 'none'}")
        return None


EVERYTHING = Selection()
