"""Blocks: their names are declared before their statements are compiled, so that none is used too early."""

from tree_sitter import Node

from grader.labs.dispatch import Step, compile_statement
from grader.labs.machine import Machine
from grader.labs.scope import Code, Scope
from grader.labs.syntax import field, parts, text_of
from grader.labs.values import UNDEFINED, Value

BREAK, CONTINUE, RETURN = "break", "continue", "return"


def compile_block(scope: Scope, nodes: list[Node]) -> Step:
    """Statements of one block; its names are declared first, so that none is used too early."""
    for node in nodes:
        if node.type == "lexical_declaration":
            kind = text_of(node.children[0])
            for name in _declared(scope, node):
                scope.declare(name, kind)
    steps = [compile_statement(scope, node) for node in nodes]

    def run(m: Machine) -> str | None:
        for step in steps:
            left = step(m)
            if left is not None:
                return left
        return None

    return steps[0] if len(steps) == 1 else run


def compile_body(scope: Scope, node: Node) -> Code:
    """The block of a function, or a whole program: gives what `return` gave, else undefined."""
    for name in _variables(scope, node):
        scope.declare(name, "var", ready=True)
    block = compile_block(scope, parts(node))

    def run(m: Machine) -> Value:
        return m.returned if block(m) is RETURN else UNDEFINED

    return run


def _declared(scope: Scope, node: Node) -> list[Node]:
    """The names that a declaration declares."""
    names: list[Node] = []
    for declarator in parts(node):
        name = field(declarator, "name")
        names.extend(_pattern(scope, name) if name.type == "array_pattern" else [name])
    return names


def _pattern(scope: Scope, node: Node) -> list[Node]:
    names = parts(node)
    if any(name.type != "identifier" for name in names):
        raise scope.refuse(node, "only plain names can stand in [ ] here")
    return names


def _variables(scope: Scope, node: Node) -> list[Node]:
    """The names declared with `var` anywhere in a function, which see them from its beginning."""
    found: list[Node] = []
    for child in parts(node):
        if child.type == "variable_declaration":
            found.extend(_declared(scope, child))
        elif child.type == "for_in_statement" and child.children[2].type == "var":
            found.append(field(child, "left"))
        if child.type != "arrow_function":
            found.extend(_variables(scope, child))
    return found
