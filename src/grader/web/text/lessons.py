"""Groups quizzes into lessons by their ids: `1.3-check` and `1.3-exercises` are of lesson 1.3."""

from dataclasses import dataclass

from grader.domain.pages.markup import plain_text
from grader.library import Library
from grader.library.lesson_ids import OTHER, find_lesson_id, rank_lesson
from grader.library.lesson_text import LessonText
from grader.questions import LessonHead, Quiz


@dataclass(frozen=True)
class Lesson:
    """Quizzes that a page shows together, with the author's text around them, if there is one."""

    id: str
    title: str
    quizzes: tuple[Quiz, ...]
    text: LessonText | None = None

    @property
    def head(self) -> LessonHead | None:
        """What the first of its quizzes that says anything about the lesson says."""
        return next((quiz.lesson for quiz in self.quizzes if quiz.lesson is not None), None)

    @property
    def name(self) -> str:
        """Its title with its name, where it has one: `Lesson 1.3: Integrators`."""
        own = self.head.title if self.head is not None else self.text.title if self.text is not None else ""
        return f"{self.title}: {plain_text(own)}" if own else self.title

    @property
    def path(self) -> str:
        """Its address."""
        return f"/lessons/{self.id}"


def group_lessons(library: Library) -> list[Lesson]:
    """Returns all lessons in the order of their numbers, also those that are text alone."""
    groups: dict[str, list[Quiz]] = {name: [] for name in library.lessons}
    for quiz in library.quizzes.values():
        groups.setdefault(find_lesson_id(quiz.id), []).append(quiz)
    return [
        Lesson(name, describe_lesson(name), tuple(groups[name]), library.lessons.get(name))
        for name in sorted(groups, key=rank_lesson)
    ]


def describe_lesson(lesson: str) -> str:
    """Returns a lesson's name."""
    return "Questions and exercises" if lesson == OTHER else f"Lesson {lesson}"
