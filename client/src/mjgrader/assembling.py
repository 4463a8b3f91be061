"""Assembles the script of a function: the statements that define it, and those that define what they name.

The statements come from the cells that were run, in order; the newest definition of a name counts. Nothing is guessed:
what is missing shows when the script runs in a fresh process."""

import ast
import builtins
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from mjgrader.errors import Sentence

BUILTINS = frozenset(dir(builtins)) | {"__name__", "__file__"}
OWN = "mjgrader"
SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


@dataclass(frozen=True)
class Statement:
    """A statement at the top of a cell: its text, the names that it binds or changes, and those that it uses."""

    text: str
    binds: frozenset[str]
    changes: frozenset[str]
    uses: frozenset[str]


def assemble(cells: Sequence[str], entry: str) -> str:
    """Returns the script that defines `entry`. Raises Sentence where no cell does."""
    statements = [statement for cell in cells for statement in read_statements(cell)]
    if not any(entry in statement.binds for statement in statements):
        raise Sentence(f"No cell defines {entry}: run the cell that has `def {entry}(...)` first.")
    chosen = {index for index, one in enumerate(statements) if "*" in one.binds}  # nobody knows what those bind
    waiting, known = [entry], set[str]()
    while waiting:
        name = waiting.pop()
        if name in known:
            continue
        known.add(name)
        for index in find_definitions(statements, name) - chosen:
            chosen.add(index)
            waiting += statements[index].uses - known - BUILTINS
    texts = [statements[index].text for index in sorted(chosen)]
    return "\n\n".join(dict.fromkeys(texts)) + "\n"


def find_definitions(statements: Sequence[Statement], name: str) -> set[int]:
    """Returns the statements that make a name what it is: the newest that binds it whole, what a binding such as
    `x = x + 1` builds on, and what changes it afterwards."""
    found = set[int]()
    for index in range(len(statements) - 1, -1, -1):
        one = statements[index]
        if name in one.changes:
            found.add(index)
        if name in one.binds:
            found.add(index)
            if name not in one.uses or is_definition(one):
                break
    return found if any(name in statements[index].binds for index in found) else set()


def is_definition(statement: Statement) -> bool:
    """Whether a statement is a function or a class, which may name itself."""
    return isinstance(ast.parse(statement.text).body[0], SCOPES)


def read_statements(cell: str) -> Iterator[Statement]:
    """Yields the statements of a cell that bind or change names; none of a cell that is not Python, and no program
    below `if __name__ == "__main__"`."""
    try:
        tree = ast.parse(cell)
    except (SyntaxError, ValueError):
        return
    lines = cell.splitlines()
    for node in tree.body:
        if is_program(node) or imports_this_client(node):
            continue
        binds, changes = frozenset(list_bound(node)), frozenset(list_changed(node))
        if binds or changes:
            first = min([node.lineno, *(one.lineno for one in getattr(node, "decorator_list", []))])
            yield Statement("\n".join(lines[first - 1 : node.end_lineno]), binds, changes, frozenset(list_used(node)))


def is_program(node: ast.stmt) -> bool:
    """Whether a statement runs only where the script is the program."""
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Compare)
        and isinstance(node.test.left, ast.Name)
        and node.test.left.id == "__name__"
    )


def imports_this_client(node: ast.stmt) -> bool:
    """Whether a statement imports mjgrader, which the server does not have."""
    if isinstance(node, ast.ImportFrom):
        return (node.module or "").partition(".")[0] == OWN
    return isinstance(node, ast.Import) and all(name.name.partition(".")[0] == OWN for name in node.names)


def walk_scope(node: ast.AST) -> Iterator[ast.AST]:
    """Yields the nodes of a statement that are outside of functions and classes."""
    yield node
    if isinstance(node, (*SCOPES, ast.Lambda)):
        return
    for child in ast.iter_child_nodes(node):
        yield from walk_scope(child)


def list_bound(node: ast.stmt) -> Iterator[str]:
    """Yields the names that a statement binds at the top of the script."""
    for one in walk_scope(node):
        if isinstance(one, SCOPES):
            yield one.name
        elif isinstance(one, (ast.Import, ast.ImportFrom)):
            yield from ((alias.asname or alias.name).partition(".")[0] for alias in one.names)
        elif isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store):
            yield one.id
        elif isinstance(one, ast.ExceptHandler) and one.name:
            yield one.name


def list_changed(node: ast.stmt) -> Iterator[str]:
    """Yields the names of objects that a statement changes, as `table["x"] = 1` and `option.y = 2` do."""
    for one in walk_scope(node):
        if isinstance(one, (ast.Attribute, ast.Subscript)) and isinstance(one.ctx, ast.Store):
            target: ast.AST = one
            while isinstance(target, (ast.Attribute, ast.Subscript)):
                target = target.value
            if isinstance(target, ast.Name):
                yield target.id


def list_used(node: ast.stmt) -> Iterator[str]:
    """Yields every name that a statement reads, at any depth; more than are needed do no harm."""
    for one in ast.walk(node):
        if isinstance(one, ast.Name) and (isinstance(one.ctx, ast.Load) or is_augmented(node, one)):
            yield one.id
        elif isinstance(one, ast.Global):
            yield from one.names


def is_augmented(node: ast.stmt, name: ast.Name) -> bool:
    """Whether a name is the target of `+=` and its like, which read it too."""
    return any(isinstance(one, ast.AugAssign) and one.target is name for one in ast.walk(node))
