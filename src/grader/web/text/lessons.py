"""Groups quizzes into lessons by their ids: `1.3-check` and `1.3-exercises` are of lesson 1.3."""

from collections.abc import Mapping
from dataclasses import dataclass

from grader.domain.markup import plain_text
from grader.library import OTHER, find_lesson_id
from grader.questions import LessonHead, Quiz


@dataclass(frozen=True)
class Lesson:
    """Quizzes that a page shows together."""

    id: str
    title: str
    quizzes: tuple[Quiz, ...]

    @property
    def head(self) -> LessonHead | None:
        """What the first of its quizzes that says anything about the lesson says."""
        return next((quiz.lesson for quiz in self.quizzes if quiz.lesson is not None), None)

    @property
    def name(self) -> str:
        """Its title with its name, where it has one: `Lesson 1.3: Integrators`."""
        return self.title if self.head is None else f"{self.title}: {plain_text(self.head.title)}"

    @property
    def path(self) -> str:
        """Its address."""
        return f"/lessons/{self.id}"


def group_lessons(quizzes: Mapping[str, Quiz]) -> list[Lesson]:
    """Returns all lessons, in the order of their first quiz."""
    groups: dict[str, list[Quiz]] = {}
    for quiz in quizzes.values():
        groups.setdefault(find_lesson_id(quiz.id), []).append(quiz)
    return [Lesson(name, describe_lesson(name), tuple(some)) for name, some in groups.items()]


def describe_lesson(lesson: str) -> str:
    """Returns a lesson's name."""
    return "Questions and exercises" if lesson == OTHER else f"Lesson {lesson}"
