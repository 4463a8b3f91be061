"""What an installed kind of exercise lacks, found before anything is judged by it."""

import ast
import sys
from collections.abc import Iterator
from typing import Any

from grader.exercises.crashes import PACKAGES
from grader.exercises.kind import Kind
from grader.exercises.parameters import ExerciseParameters
from grader.questions import FORMS

IN_JAIL = frozenset({"mujoco", "numpy", "scipy"})
"""What a driver may import beside the standard library."""


def list_lacks(kind: Any) -> Iterator[str]:
    """Yields what a kind lacks, with the cure."""
    if not isinstance(kind, Kind):
        yield "derive it from grader.exercises.Kind"
        return
    parameters = getattr(kind, "parameters", None)
    if not (isinstance(parameters, type) and issubclass(parameters, ExerciseParameters)):
        yield "set `parameters` to a model that derives from grader.exercises.ExerciseParameters"
    if not kind.takes or not {*kind.takes} <= {*FORMS}:
        yield f"set `takes` to a tuple of {', '.join(map(repr, FORMS))}"
    if kind.plays and type(kind).play is Kind.play:
        yield "define `play`, or leave `plays` out"
    yield from list_program_lacks(getattr(kind, "driver", None), "driver", "trial(functions, inputs, submit)")
    if kind.measurement is not None:
        yield from list_program_lacks(kind.measurement.program, "measurement", "measure(inputs, results, submit)")


def list_program_lacks(source: Any, name: str, function: str) -> Iterator[str]:
    """Yields what a program for the jail lacks, which must define `function`."""
    if not isinstance(source, str):
        yield f"set `{name}` to the text of a module that defines {function}"
        return
    try:
        module = ast.parse(source)
    except (SyntaxError, ValueError) as error:
        yield f"correct the {name}, which is no Python: {error}"
        return
    if function.partition("(")[0] not in set(list_functions(module)):
        yield f"define {function} in the {name}"
    for imported in sorted(set(list_imports(module)) - IN_JAIL - sys.stdlib_module_names):
        yield f"remove the import of {imported!r} from the {name}: the jail has {PACKAGES}, and not your package"


def list_functions(module: ast.Module) -> Iterator[str]:
    """Yields the names that a module defines a function by, or assigns one to."""
    for part in module.body:
        if isinstance(part, ast.FunctionDef):
            yield part.name
        elif isinstance(part, ast.Assign):
            yield from (target.id for target in part.targets if isinstance(target, ast.Name))


def list_imports(module: ast.Module) -> Iterator[str]:
    """Yields the packages that a module imports, wherever it does."""
    for part in ast.walk(module):
        if isinstance(part, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in part.names)
        elif isinstance(part, ast.ImportFrom):
            yield "." if part.level else str(part.module).partition(".")[0]
