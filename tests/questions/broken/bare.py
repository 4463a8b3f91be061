"""A kind without a template beside it."""

from grader.questions.kinds.text import Text


class NoTemplate(Text):
    """A whole kind otherwise."""
