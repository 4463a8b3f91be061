"""Type a number, with or without a unit."""

from grader.questions.kinds.number.kind import Number, NumberQuestion

__all__ = ["Number", "NumberQuestion"]
