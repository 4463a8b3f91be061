"""Pieces of compiled code: Python's `ast` of a few node types, made from templates, with what is known of their values.
A template is Python text of our own, such as `V if kind_of(FIRST) is float_type else number(machine, V)`; its names in
capitals are places that nodes, lists of nodes, or names of variables fill."""

import ast
import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from grader.expressions import runtime

ALLOWED = (
    ast.Module, ast.FunctionDef, ast.arguments, ast.arg, ast.Return, ast.Assign, ast.AugAssign, ast.Expr, ast.Pass,
    ast.If, ast.While, ast.For, ast.Break, ast.Continue, ast.Nonlocal, ast.Try, ast.ExceptHandler, ast.Raise,
    ast.Name, ast.Constant, ast.Subscript, ast.Call, ast.Starred, ast.List, ast.Tuple, ast.NamedExpr, ast.IfExp,
    ast.Compare, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.expr_context, ast.operator, ast.unaryop, ast.boolop,
    ast.cmpop,
)  # fmt: skip
"""The node types of compiled code. No attribute, import, lambda or comprehension is among them."""

ALLOWED_EXACTLY = {allowed for kind in ALLOWED for allowed in (kind, *kind.__subclasses__())}
"""With the operators and contexts. To look one up takes a fraction of the time of `isinstance`."""

PLACED = (ast.expr, ast.stmt, ast.arg, ast.excepthandler)
"""The node types that have a line number."""

OWN_NAME = re.compile(r"[a-z][0-9]+|run|make|given|machine|budget|ctx|error|failure|failed")
UNPLACED = 1
"""The line number of code whose errors belong to the place that called it."""

PAY = "budget[0] += 1\nif budget[0] > budget[1]: raise_exhausted()"
"""Use up one tick of the budget, and fail where none is left."""

Part = ast.expr | str | list[ast.expr] | list[ast.stmt]


class ValueKind(Enum):
    """What is known of a value when compiling."""

    NUMBER = "a float"
    BOOLEAN = "a bool"
    ELEMENT = "a float, or undefined past the end of a field: the last branch of the term's IfExp"
    ANY = "any value"


@dataclass
class Term:
    """The code of an expression, with what is known of its value."""

    code: ast.expr
    kind: ValueKind = ValueKind.ANY

    @property
    def stored_kind(self) -> ValueKind:
        """What is known of the value once it is stored or chosen."""
        return ValueKind.ANY if self.kind is ValueKind.ELEMENT else self.kind


def join_kinds(one: ValueKind, other: ValueKind) -> ValueKind:
    """What is known of a value that may be either."""
    return one if one is other else ValueKind.ANY


def build_statements(template: str, **parts: Part) -> list[ast.stmt]:
    """Returns the statements of a template. A list that fills a place is inserted node by node."""
    filled: list[ast.stmt] = _fill(_parsed(template).body, parts)
    return filled


def build_expression(template: str, **parts: Part) -> ast.expr:
    """Returns the expression of a template."""
    (statement,) = build_statements(template, **parts)
    assert isinstance(statement, ast.Expr), template
    return statement.value


_parsed = functools.lru_cache(maxsize=256)(ast.parse)


def _fill(node: Any, parts: Mapping[str, Part]) -> Any:
    """Returns a copy of a node, or of a list of them, without positions."""
    kind = type(node)
    if kind is ast.Name:
        part = parts.get(node.id, node.id)
        return ast.Name(part, node.ctx) if isinstance(part, str) else part
    if kind is list:
        filled = [_fill(child, parts) for child in node]
        return [part for child in filled for part in (child if isinstance(child, list) else [child])]
    if kind is ast.Expr and isinstance(node.value, ast.Name):
        inner = _fill(node.value, parts)
        return inner if isinstance(inner, list) else ast.Expr(inner)
    if isinstance(node, ast.AST) and kind._fields:  # an operator has none, and is not copied
        return kind(*[_fill(getattr(node, field), parts) for field in kind._fields])
    return node


def build_name(identifier: str) -> ast.expr:
    """Returns a variable that is read."""
    return ast.Name(identifier, ast.Load())


def build_constant(value: float | bool | str | None) -> Term:
    """Returns a value that is known when compiling."""
    kind = (
        ValueKind.NUMBER
        if isinstance(value, float)
        else ValueKind.BOOLEAN
        if isinstance(value, bool)
        else ValueKind.ANY
    )
    return Term(ast.Constant(value), kind)


def build_sequence(*values: ast.expr) -> ast.expr:
    """Code that evaluates all the values, and gives the last."""
    return values[0] if len(values) == 1 else build_expression("(VALUES,)[-1]", VALUES=list(values))


def finish_code(node: ast.AST, line: int = UNPLACED) -> None:
    """Give every node its line number, and check that nothing but our own nodes and names is there."""
    assert type(node) in ALLOWED_EXACTLY, type(node)
    identifier = getattr(node, "id", None) or getattr(node, "arg", None)
    assert identifier is None or identifier in runtime.NAMES or OWN_NAME.fullmatch(identifier), identifier
    if isinstance(node, PLACED):
        line = getattr(node, "lineno", line)
        node.lineno = node.end_lineno = line
        node.col_offset = node.end_col_offset = 0
    for child in ast.iter_child_nodes(node):
        finish_code(child, line)
