"""What plug-ins of every sort share: how an entry point is loaded, and what a kind remarks on an author's keys."""

from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from pathlib import Path
from traceback import walk_tb
from typing import Any, NamedTuple

from grader.errors import PluginError


class Remark(NamedTuple):
    """What is wrong or doubtful about a question or lab: the author's key (`fields.0.unit` of an inner one), and why,
    with the cure."""

    key: str
    why: str


def find_points(group: str) -> EntryPoints:
    """Returns what the installed packages offer in this entry-point group."""
    points: EntryPoints = _read_points().select(group=group)
    return points


@cache
def _read_points() -> Any:
    """Reads what every installed package offers: with a hundred of them each reading takes 10 ms."""
    return entry_points()


def load_point(point: EntryPoint, what: str) -> Any:
    """Makes what an entry point names; an error calls it `what`. Raises PluginError."""
    try:
        return point.load()()
    except Exception as error:  # code of another package: anything may be raised
        package = point.dist.name if point.dist else "its package"
        why = f"{describe_error(error, point.module)}; correct or uninstall {package}"
        raise PluginError(f"the {what} {point.name!r} ({point.value}) cannot be loaded: {why}") from error


def describe_error(error: BaseException, module: str) -> str:
    """Returns what was raised, and the deepest line of the package of `module` that it passed."""
    package, place = module.partition(".")[0], ""
    for frame, line in walk_tb(error.__traceback__):
        if str(frame.f_globals.get("__name__")).partition(".")[0] == package:
            place = f" ({Path(frame.f_code.co_filename).name}, line {line})"
    return f"{type(error).__name__}: {' '.join(str(error).split())}{place}"
