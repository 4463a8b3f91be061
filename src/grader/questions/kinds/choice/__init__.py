"""Choose one of several options."""

from grader.questions.kinds.choice.kind import Choice, ChoiceQuestion

__all__ = ["Choice", "ChoiceQuestion"]
