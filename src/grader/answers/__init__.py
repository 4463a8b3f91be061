"""Answers that need no jail: reads a choice, a typed number or a text, and grades it."""

from grader.answers.grade import grade_answer, read_answer
from grader.answers.units import convert, known_unit

__all__ = ["convert", "grade_answer", "known_unit", "read_answer"]
