"""Write a text, which an instructor reads and grades."""

from grader.questions.kinds.text.kind import Text, TextQuestion

__all__ = ["Text", "TextQuestion"]
