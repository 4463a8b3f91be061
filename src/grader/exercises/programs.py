"""Runs the programs of authors in the grader's own process: their texts are trusted, as the content folder is."""

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from grader.errors import GraderError
from grader.exercises.kind import TextOf
from grader.exercises.parameters import WrongParameter

Program = Mapping[str, Any]
"""The names that an author's program defines."""


@lru_cache(maxsize=64)
def run_program(path: str, text: str) -> Program:
    """Runs an author's program in a namespace of its own. Raises ValueError if that fails."""
    names: dict[str, Any] = {"__name__": "program", "__file__": path}
    try:
        exec(compile(text, path, "exec"), names)  # noqa: S102 - the text is the author's, which is trusted
    except (Exception, SystemExit) as error:
        line = f"line {error.lineno}: " if isinstance(error, SyntaxError) else ""
        raise ValueError(f"{path}: {line}{type(error).__name__}: {error}") from error
    return MappingProxyType(names)


def load_program(path: str, text_of: TextOf, key: str, *functions: str) -> Program:
    """Returns a program of the content folder that defines `functions`. Raises WrongParameter."""
    try:
        program = run_program(path, text_of(path))
    except (GraderError, ValueError) as error:
        raise WrongParameter(key, str(error)) from error
    for name in functions:
        if not callable(program.get(name)):
            raise WrongParameter(key, f"{path} defines no function {name}")
    return program
