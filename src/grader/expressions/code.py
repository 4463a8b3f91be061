"""Pieces of compiled code: Python `ast` nodes of a few types, with what is known of their values."""

import ast
import re
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

OWN_NAME = re.compile(r"[a-z][0-9]+|run|make|given|machine|budget|ctx|error|failure|failed")
UNPLACED = 1
"""The line number of code whose errors belong to the place that called it."""


class Kind(Enum):
    """What is known of a value when compiling."""

    NUMBER = "a float"
    BOOLEAN = "a bool"
    ELEMENT = "a float, or undefined past the end of a field: the last branch of the term's IfExp"
    ANY = "any value"


@dataclass
class Term:
    """The code of an expression, with what is known of its value."""

    code: ast.expr
    kind: Kind = Kind.ANY

    @property
    def kept(self) -> Kind:
        """What is known of the value once it is stored or chosen."""
        return Kind.ANY if self.kind is Kind.ELEMENT else self.kind

    @property
    def literal(self) -> float | None:
        """The number where it is known when compiling."""
        value = self.code.value if isinstance(self.code, ast.Constant) else None
        return value if isinstance(value, float) else None


def join(one: Kind, other: Kind) -> Kind:
    """What is known of a value that may be either."""
    return one if one is other else Kind.ANY


def name(identifier: str) -> ast.expr:
    """A variable that is read."""
    return ast.Name(identifier, ast.Load())


def target(identifier: str) -> ast.Name:
    """A variable that is assigned."""
    return ast.Name(identifier, ast.Store())


def item(container: str, key: ast.expr) -> ast.expr:
    """`container[key]`."""
    return ast.Subscript(name(container), key, ast.Load())


def call(function: str, *args: ast.expr) -> ast.expr:
    """`function(*args)`."""
    return ast.Call(name(function), list(args), [])


def constant(value: Any) -> ast.expr:
    """A number, text, boolean or None."""
    return ast.Constant(value)


def listed(items: list[ast.expr]) -> ast.expr:
    """`[*items]`."""
    return ast.List(items, ast.Load())


def in_turn(*values: ast.expr) -> ast.expr:
    """Code that evaluates all the values, and gives the last."""
    if len(values) == 1:
        return values[0]
    return ast.Subscript(ast.Tuple(list(values), ast.Load()), constant(len(values) - 1), ast.Load())


def assign(identifier: str, value: ast.expr) -> ast.stmt:
    """`identifier = value`."""
    return ast.Assign([target(identifier)], value)


def compare(left: ast.expr, operator: type[ast.cmpop], right: ast.expr) -> ast.expr:
    """`left operator right`."""
    return ast.Compare(left, [operator()], [right])


def negated(test: ast.expr) -> ast.expr:
    """`not test`."""
    return ast.UnaryOp(ast.Not(), test)


def pay() -> list[ast.stmt]:
    """Use up one tick of the budget, and fail where none is left."""
    spend = ast.AugAssign(ast.Subscript(name("budget"), constant(0), ast.Store()), ast.Add(), constant(1))
    test = compare(item("budget", constant(0)), ast.Gt, item("budget", constant(1)))
    return [spend, ast.If(test, [ast.Expr(call("exhausted"))], [])]


def function(identifier: str, parameters: list[str], body: list[ast.stmt], *, lenient: bool = False) -> ast.FunctionDef:
    """`def identifier(...)`; a lenient one takes undefined for missing arguments, and ignores further ones."""
    defaults = [name("undefined") for _ in parameters] if lenient else []
    rest = ast.arg("r0") if lenient else None
    arguments = ast.arguments([], [ast.arg(p) for p in parameters], rest, [], [], None, defaults)
    return ast.FunctionDef(identifier, arguments, body or [ast.Pass()], [])


def finish(node: ast.AST, line: int = UNPLACED) -> None:
    """Give every node its line number, and check that nothing but our own nodes and names is there."""
    assert isinstance(node, ALLOWED), type(node)
    identifier = getattr(node, "id", None) or getattr(node, "arg", None)
    assert identifier is None or identifier in runtime.NAMES or OWN_NAME.fullmatch(identifier), identifier
    if isinstance(node, ast.expr | ast.stmt | ast.arg | ast.excepthandler):
        line = getattr(node, "lineno", line)
        node.lineno = node.end_lineno = line
        node.col_offset = node.end_col_offset = 0
    for child in ast.iter_child_nodes(node):
        finish(child, line)
