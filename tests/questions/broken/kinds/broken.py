"""Kinds of question that must be refused; the template beside this module has no field."""

from grader.questions import Question
from grader.questions.kinds.text import Text


class NoField(Text):
    """Its template has no field."""


class Unnamed(Question):
    """A model that leaves its names open."""


class NoNames(Text):
    """Authors cannot choose it."""

    question = Unnamed  # type: ignore[assignment]


class NoQuestion(Text):
    """Its model is none."""

    question = int  # type: ignore[assignment]


class NoKind:
    """Not a kind at all."""


class Raises(Text):
    """Cannot be made."""

    def __init__(self) -> None:
        raise ZeroDivisionError
