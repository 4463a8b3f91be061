"""What plug-ins of every sort share: how an entry point is loaded, and what a kind remarks on an author's keys."""

from importlib.metadata import EntryPoint
from typing import Any, NamedTuple

from grader.errors import GraderError


class Remark(NamedTuple):
    """What is wrong or doubtful about a question or lab: the author's key (`fields.0.unit` of an inner one), and why,
    with the cure."""

    key: str
    why: str


def load_point(point: EntryPoint, what: str) -> Any:
    """Makes what an entry point names; an error calls it `what`. Raises GraderError."""
    try:
        return point.load()()
    except Exception as error:  # code of another package: anything may be raised
        package = point.dist.name if point.dist else "its package"
        why = f"{type(error).__name__}: {error}; correct or uninstall {package}"
        raise GraderError(f"the {what} {point.name!r} ({point.value}) cannot be loaded: {why}") from error
