"""Quizzes in Markdown: `quizzes/NAME.md` is read as the JSON of the same quiz, and a quiz is written as Markdown."""

from grader.library.markdown.reading import read_markdown
from grader.library.markdown.writing import write_lab, write_markdown, write_question

__all__ = ["read_markdown", "write_lab", "write_markdown", "write_question"]
