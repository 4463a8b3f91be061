"""Which compiler takes which node of the tree; the modules that know the nodes register theirs here."""

from collections.abc import Callable
from typing import TypeVar

from tree_sitter import Node

from grader.labs.machine import Machine
from grader.labs.scope import Code, Scope
from grader.labs.values import Trouble

Result = TypeVar("Result")
Step = Callable[[Machine], str | None]
"""A statement: returns None, or how control leaves it (break, continue, return)."""

EXPRESSIONS: dict[str, Callable[[Scope, Node], Code]] = {}
STATEMENTS: dict[str, Callable[[Scope, Node], Step]] = {}


def compile_term(scope: Scope, node: Node) -> Code:
    """Code that gives the value of an expression. Raises Refused for what the language does not have."""
    compiler = EXPRESSIONS.get(node.type)
    if compiler is None:
        raise scope.refuse(node, f"{node.type.replace('_', ' ')} is not part of the language of labs")
    return compiler(scope, node)


def compile_statement(scope: Scope, node: Node) -> Step:
    """Code of one statement. Raises Refused for what the language does not have."""
    compiler = STATEMENTS.get(node.type)
    if compiler is None:
        raise scope.refuse(node, f"{node.type.replace('_', ' ')} is not part of the language of labs")
    return compiler(scope, node)


def located(scope: Scope, node: Node, code: Callable[[Machine], Result]) -> Callable[[Machine], Result]:
    """The same code; trouble in it that has no place yet gets this node's."""
    at = scope.source.place(node)

    def run(m: Machine) -> Result:
        try:
            return code(m)
        except Trouble as trouble:
            trouble.at = trouble.at or at
            raise

    return run
