"""Runs the programs of authors in the grader's own process: their texts are trusted, as the content folder is. Those
that make arguments run in the jail (`running/program_calls.py`)."""

import sys
from collections.abc import Callable, Mapping
from functools import lru_cache
from types import FrameType, MappingProxyType
from typing import Any, TypeVar

from grader.errors import GraderError
from grader.exercises.driving.program_caller import NAME
from grader.exercises.kind import TextOf
from grader.exercises.parameters import WrongParameter

Program = Mapping[str, Any]
"""The names that an author's program defines."""

LINES_MAX = 10_000_000
"""Lines of a program that one call may run: about 2 s. They are counted, so that load changes no verdict."""

T = TypeVar("T")


class End(BaseException):
    """Ends a program that runs too long: no `except Exception` catches it."""


class TooManyLines(ValueError):
    """An author's program that runs too long."""


def limit_lines(function: Callable[[], T], lines_max: int = LINES_MAX) -> T:
    """Returns what a function returns. Raises TooManyLines where authors' programs run more lines in it, ValueError
    where they call exit(). Python 3.11 counts no lines in `while True: pass` on one line, later versions do."""
    left = lines_max

    def follow(frame: FrameType, event: str, _: object) -> Any:
        nonlocal left
        if frame.f_globals.get("__name__") != NAME:
            return None
        left -= event == "line"
        if left < 0:
            raise End
        return follow

    before = sys.gettrace()
    sys.settrace(follow)
    try:
        return function()
    except End:
        raise TooManyLines(f"it runs more than {lines_max:,} lines: bound its loops") from None
    except SystemExit as error:  # it would end the grader, and with `exit(0)` as if all were well
        raise ValueError("it calls exit(): return a result, or raise an exception") from error
    finally:
        sys.settrace(before)


@lru_cache(maxsize=64)
def run_program(path: str, text: str) -> Program:
    """Runs an author's program in a namespace of its own. Raises ValueError if that fails."""
    names: dict[str, Any] = {"__name__": NAME, "__file__": path}
    try:
        code = compile(text, path, "exec")
        limit_lines(lambda: exec(code, names))  # noqa: S102 - the text is the author's, which is trusted
    except Exception as error:
        line = f"line {error.lineno}: " if isinstance(error, SyntaxError) else ""
        raise ValueError(f"{path}: {line}{type(error).__name__}: {error}") from error
    return MappingProxyType(names)


def run_again(program: Program, text: str) -> Program:
    """Returns a program as it is before any call, run anew from its `text`. Raises ValueError if that fails."""
    return run_program.__wrapped__(str(program["__file__"]), text)


def load_program(path: str, text_of: TextOf, key: str, *functions: str) -> Program:
    """Returns a program of the content folder that defines `functions`. Raises WrongParameter."""
    try:
        program = run_program(path, text_of(path))
    except (GraderError, ValueError) as error:
        raise WrongParameter(key, str(error)) from error
    for name in functions:
        if not callable(program.get(name)):
            defined = [
                item for item, value in program.items() if getattr(value, "__module__", "") == NAME and callable(value)
            ]
            raise WrongParameter(key, f"{path} defines no function {name}; it defines {', '.join(defined) or 'none'}")
    return program
