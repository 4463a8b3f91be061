"""A kind without the files beside it."""

from grader.labs.kinds.integrators import Integrators


class NoFiles(Integrators):
    """A whole kind otherwise."""
