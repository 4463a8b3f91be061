"""Choose all right ones of several options."""

from grader.questions.kinds.multiple.kind import Multiple, MultipleQuestion

__all__ = ["Multiple", "MultipleQuestion"]
