"""Makes every small edit of a program's syntax tree, one after the other. This text runs in the jail too, so it imports
the standard library alone."""

import ast
from collections.abc import Iterator
from math import pi
from typing import Any

EXCHANGED_FUNCTIONS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh", "exp": "log", "log": "exp"}
EXCHANGED_FIELDS = {
    "qpos": "qvel",
    "qvel": "qpos",
    "xpos": "xipos",
    "xipos": "xpos",
    "xmat": "ximat",
    "ximat": "xmat",
    "body_pos": "body_ipos",
    "body_ipos": "body_pos",
    "jnt_qposadr": "jnt_dofadr",
    "jnt_dofadr": "jnt_qposadr",
    "qacc": "qacc_smooth",
    "qacc_smooth": "qacc",
    "xquat": "body_quat",
    "body_mass": "body_subtreemass",
}
TURNING = frozenset({"sin", "cos", "tan"})
LEFT_OUT = frozenset({"sqrt", "abs", "fabs", "square", "cumsum", "deg2rad", "rad2deg", "radians", "degrees", "norm"})
"""Functions of one number that are easily forgotten."""
COUNTING = frozenset({"range", "arange"})
OPPOSITE: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
KIND_OF = {ast.Add: "sign", ast.Sub: "sign", ast.Mult: "quotient", ast.Div: "quotient"}
MOVED = (ast.Assign, ast.AugAssign, ast.Expr)
COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt), ast.LtE: (ast.Lt, ast.GtE), ast.Gt: (ast.GtE, ast.Lt), ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,),
}  # fmt: skip

Edit = tuple[str, int]
"""The kind of an edit, and the line of the program."""


def make_edits(tree: ast.Module, functions: frozenset[str]) -> Iterator[Edit]:
    """Edits the tree, and yields each edit while it stands. Only the bodies of these functions are edited. Two edits
    with the same text come twice."""
    for function in tree.body:
        if isinstance(function, ast.FunctionDef) and function.name in functions:
            for parent in list(ast.walk(function)):
                if isinstance(parent, ast.arguments):
                    continue
                yield from edit_slots(parent)


def find_functions(tree: ast.Module, entry: str) -> frozenset[str]:
    """Returns the names of a function and of those of the same file that it may call."""
    known = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    functions, left = set[str](), [entry]
    while left:
        name = left.pop()
        if name in known and name not in functions:
            functions.add(name)
            left += [node.id for node in ast.walk(known[name]) if isinstance(node, ast.Name)]
    return frozenset(functions)


def edit_slots(parent: ast.AST) -> Iterator[Edit]:
    """Edits the children of a node, one after the other."""
    for field, value in list(ast.iter_fields(parent)):
        if isinstance(value, list):
            for index, child in enumerate(list(value)):
                if isinstance(child, ast.AST):
                    for kind, new in propose(child, parent):
                        value[index] = ast.copy_location(new, child)
                        yield kind, getattr(child, "lineno", 0)
                        value[index] = child
            yield from exchange_neighbours(parent, field, value)
        elif isinstance(value, ast.AST) and not isinstance(value, ast.expr_context):
            for kind, new in propose(value, parent):
                setattr(parent, field, ast.copy_location(new, value))
                yield kind, getattr(value, "lineno", 0) or getattr(parent, "lineno", 0)
                setattr(parent, field, value)


def exchange_neighbours(parent: ast.AST, field: str, items: list[Any]) -> Iterator[Edit]:
    """Exchanges two statements, or two arguments of a call, that follow each other."""
    kind = {"body": "statements", "args": "arguments"}.get(field, "")
    if not kind or isinstance(parent, ast.arguments):
        return
    for index in range(len(items) - 1):
        one, other = items[index : index + 2]
        if kind == "statements" and not all(isinstance(each, MOVED) for each in (one, other)):
            continue
        items[index : index + 2] = other, one
        yield kind, getattr(one, "lineno", 0)
        items[index : index + 2] = one, other


def propose(node: ast.AST, parent: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yields the kind of each edit of a node, and what takes its place."""
    if isinstance(node, ast.Constant):
        yield from propose_numbers(node, parent)
    elif isinstance(node, ast.BinOp):
        yield from propose_operations(node)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) and not isinstance(node.operand, ast.Constant):
        yield "sign", node.operand
    elif isinstance(node, ast.Call):
        yield from propose_calls(node)
    elif isinstance(node, ast.Compare) and len(node.ops) == 1:
        for op in COMPARED.get(type(node.ops[0]), ()):
            yield "comparison", ast.Compare(node.left, [op()], node.comparators)
    elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
        yield from propose_fields(node)
    elif isinstance(node, ast.stmt):
        yield from propose_statements(node)


def propose_fields(node: ast.Attribute) -> Iterator[tuple[str, ast.AST]]:
    """Yields edits of an attribute that is read."""
    if node.attr == "T":
        yield "transpose", node.value
    elif node.attr in EXCHANGED_FIELDS:
        yield "field", ast.Attribute(node.value, EXCHANGED_FIELDS[node.attr], node.ctx)


def propose_statements(node: ast.stmt) -> Iterator[tuple[str, ast.AST]]:
    """Yields edits of a statement."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield "call", ast.Pass()
    elif isinstance(node, ast.AugAssign):
        yield "update", ast.Pass()
        if type(node.op) in OPPOSITE:
            yield KIND_OF[type(node.op)], ast.AugAssign(node.target, OPPOSITE[type(node.op)](), node.value)


def propose_numbers(node: ast.Constant, parent: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yields edits of a number: of an index or a bound by one, of any other by a factor."""
    value = node.value
    if isinstance(value, bool) or not isinstance(value, int | float):
        return
    is_bound = isinstance(parent, ast.Call) and get_name(parent.func) in COUNTING
    if isinstance(parent, ast.Subscript | ast.Slice) or is_bound:
        yield "index", ast.Constant(value + 1)
        yield "index", ast.Constant(value - 1)
        return
    if isinstance(parent, ast.BinOp) and isinstance(parent.op, ast.Pow) and parent.right is node:
        yield "power", ast.Constant(value + 1)
        yield "power", ast.Constant(value - 1)
        return
    if value:
        yield "twice", ast.Constant(2 * value)
        yield "half", ast.Constant(value / 2)
        yield "negative", ast.UnaryOp(ast.USub(), ast.Constant(value))


def propose_operations(node: ast.BinOp) -> Iterator[tuple[str, ast.AST]]:
    """Yields edits of an operation with two sides."""
    op = type(node.op)
    if op in OPPOSITE:
        yield KIND_OF[op], ast.BinOp(node.left, OPPOSITE[op](), node.right)
        kind = "term" if op in (ast.Add, ast.Sub) else "factor"
        yield kind, node.left
        if op is not ast.Div:
            yield kind, node.right
    if op in (ast.Sub, ast.Div, ast.MatMult):
        yield "order", ast.BinOp(node.right, node.op, node.left)
    if op is ast.Pow:
        yield "power", node.left
    if op is ast.FloorDiv:
        yield "quotient", ast.BinOp(node.left, ast.Div(), node.right)


def propose_calls(node: ast.Call) -> Iterator[tuple[str, ast.AST]]:
    """Yields edits of a call."""
    name = get_name(node.func)
    if name in EXCHANGED_FUNCTIONS:
        yield "function", ast.Call(rename(node.func, EXCHANGED_FUNCTIONS[name]), node.args, node.keywords)
    if len(node.args) == 1 and name in LEFT_OUT:
        yield "left out", node.args[0]
    if len(node.args) == 1 and name in TURNING:
        for kind, factor in (("degrees", pi / 180), ("in degrees", 180 / pi)):
            angle = ast.BinOp(node.args[0], ast.Mult(), ast.Constant(factor))
            yield kind, ast.Call(node.func, [angle], node.keywords)
    if name in COUNTING and node.args:
        for place in range(min(len(node.args), 2)):
            for step in (ast.Add(), ast.Sub()):
                arguments = list(node.args)
                arguments[place] = ast.BinOp(arguments[place], step, ast.Constant(1))
                yield "index", ast.Call(node.func, arguments, node.keywords)


def get_name(function: ast.expr) -> str:
    """Returns the name of a function or method; empty if it has none."""
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def rename(function: ast.expr, name: str) -> ast.expr:
    """Returns another function of the same module."""
    if isinstance(function, ast.Attribute):
        return ast.Attribute(function.value, name, function.ctx)
    return ast.Name(name, ast.Load())
