"""Finds where a script computes a value that it writes, and where it keeps a field of data without a copy."""

import ast
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from grader.exercises.explaining.script import (
    ParsedScript,
    is_field,
    list_items,
    list_pairs,
    read_name,
    reads_name,
    walk_within,
    writes_field,
)


def find_origin(script: ParsedScript, line: int, field: str) -> int:
    """Returns the line that computes what the statement on a line writes into a field: where that is a variable, the
    line above it in the same block that gives the variable its value; else the line itself."""
    place = next(((block, index) for block, index in list_places(script) if block[index].lineno == line), None)
    if place is None or not writes_field(place[0][place[1]], field):
        return line
    block, index = place
    name = find_source(block[index], lambda target: is_target(target, field))
    while name is not None:
        index = next((above for above in range(index - 1, -1, -1) if binds(block[above], name)), -1)
        if index < 0 or not isinstance(block[index], ast.Assign | ast.AugAssign | ast.AnnAssign):
            return line
        line = block[index].lineno
        name = find_source(block[index], partial(reads_name, name=name))
    return line


def find_source(statement: ast.stmt, matches: Callable[[ast.expr], bool]) -> str | None:
    """Returns the variable whose value an assignment gives to a target that matches; None where it is no variable."""
    if not isinstance(statement, ast.Assign):
        return None
    if isinstance(statement.value, ast.Name):
        return statement.value.id
    pairs = (value for target, value in list_pairs(statement) if matches(target))
    return next((value.id for value in pairs if isinstance(value, ast.Name)), None)


def list_places(script: ParsedScript) -> Iterator[tuple[Sequence[ast.stmt], int]]:
    """Yields every statement as its block and its place there."""
    for node in script.nodes:
        for name in ("body", "orelse", "finalbody"):
            block = getattr(node, name, None)
            if isinstance(block, list):
                yield from ((block, index) for index in range(len(block)))


def is_target(target: ast.expr, field: str) -> bool:
    """Whether an assignment to this target writes an attribute of this name, or into it."""
    inner = target.value if isinstance(target, ast.Subscript) else target
    return isinstance(inner, ast.Attribute) and inner.attr == field


def binds(statement: ast.stmt, name: str) -> bool:
    """Whether a statement, or one within it, gives a variable a value, or changes the array that it names."""
    return any(
        (isinstance(node, ast.Name) and node.id == name and isinstance(node.ctx, ast.Store))
        or (isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store) and read_name(node.value) == name)
        for node in walk_within(statement)
    )


def find_view(script: ParsedScript, fields: Sequence[str]) -> int | None:
    """Returns the first line that gives one of these fields of data a name, returns it, or appends it, without a copy;
    None where none does."""
    values = list_kept_values(script)
    return min((line for line, value in values if any(is_field(value, field) for field in fields)), default=None)


CHANGING = ("qpos", "qvel", "qacc", "act", "ctrl", "sensordata", "xpos", "xquat", "site_xpos", "energy")
"""Fields of data that a simulation goes on changing."""


def find_appended_view(script: ParsedScript) -> tuple[int, str] | None:
    """Returns the first line that appends a field of data to a list without a copy, and the field; None where none
    does."""
    found = [
        (node.lineno, field)
        for node in script.nodes
        if isinstance(node, ast.Call) and read_name(node.func) == "append"
        for argument in node.args
        for value in list_items(argument)
        for field in CHANGING
        if is_field(value, field)
    ]
    return min(found, default=None)


def list_kept_values(script: ParsedScript) -> Iterator[tuple[int, ast.expr]]:
    """Yields each value that a script keeps, with its line."""
    for node in script.nodes:
        if isinstance(node, ast.Assign | ast.AnnAssign | ast.NamedExpr | ast.Return):
            yield from ((node.lineno, value) for value in list_items(node.value))
        elif isinstance(node, ast.Call) and read_name(node.func) == "append":
            yield from ((node.lineno, value) for argument in node.args for value in list_items(argument))
