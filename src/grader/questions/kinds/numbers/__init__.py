"""Type several numbers, with or without units."""

from grader.questions.kinds.numbers.kind import Numbers, NumbersQuestion

__all__ = ["Numbers", "NumbersQuestion"]
