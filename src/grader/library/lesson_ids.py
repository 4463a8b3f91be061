"""Which lesson a quiz belongs to, and the order of both: `1.3-check` and `1.3-exercises` are of lesson 1.3."""

import re

NUMBERED = re.compile(r"(\d+(?:\.\d+)*)-")
OTHER = "questions"
"""The lesson of quizzes whose ids begin with no number."""


def find_lesson_id(quiz_id: str) -> str:
    """Returns the lesson that a quiz belongs to."""
    match = NUMBERED.match(quiz_id)
    return OTHER if match is None else match[1]


def rank_lesson(lesson: str) -> tuple[int, ...]:
    """Returns what lessons are sorted by: 1.9 before 1.10, and those without a number at the end."""
    return (1,) if lesson == OTHER else (0, *map(int, lesson.split(".")))


def rank_quiz(quiz_id: str) -> tuple[tuple[int, ...], list[str | int]]:
    """Returns what quizzes are sorted by: their lesson, then their id, `week-9` before `week-10`."""
    parts = re.split(r"([0-9]+)", quiz_id)
    return rank_lesson(find_lesson_id(quiz_id)), [int(part) if at % 2 else part for at, part in enumerate(parts)]
