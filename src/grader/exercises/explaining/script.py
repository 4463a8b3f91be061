"""Reads the text of a script: its loops, names and assignments, and their lines. It explains, and never decides."""

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

LOOPS = (ast.For, ast.AsyncFor, ast.While)
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
MUTABLE = (ast.List, ast.Dict, ast.Set, ast.ListComp, ast.DictComp, ast.SetComp, ast.Call)
"""Values that keep what is put into them; a call may make one."""
CACHES = frozenset({"cache", "lru_cache", "cached_property"})

COPYING = frozenset({"array", "copy", "deepcopy", "concatenate", "hstack"})
"""Functions that make a new array of what they are given."""

SOURCE_BYTES_MAX = 64 * 1024
"""A longer script is not read: its syntax tree would take much memory."""


@dataclass(frozen=True, eq=False)
class ParsedScript:
    """The text of a script, empty where it is unknown."""

    source: str = ""

    @cached_property
    def tree(self) -> ast.Module | None:
        """The syntax tree; None where the text is unknown, too long, or no Python."""
        if not self.source or len(self.source) > SOURCE_BYTES_MAX:
            return None
        try:
            return ast.parse(self.source)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            return None

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """All nodes of the syntax tree."""
        return tuple(ast.walk(self.tree)) if self.tree else ()

    @cached_property
    def names(self) -> frozenset[str]:
        """Every name and attribute, and every text: what `getattr` may be called with."""
        used: set[str] = set()
        for node in self.nodes:
            if isinstance(node, ast.Name):
                used.add(node.id)
            elif isinstance(node, ast.Attribute):
                used.add(node.attr)
            elif isinstance(node, ast.alias):
                used.update(node.name.split("."))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                used.add(node.value)
        return frozenset(used)

    @property
    def has_yield(self) -> bool:
        """Whether a function is a generator, by a `yield` of its own."""
        return any(isinstance(node, ast.Yield | ast.YieldFrom) for node in self.nodes)

    @property
    def has_coroutine(self) -> bool:
        """Whether there is an `async def`."""
        return any(isinstance(node, ast.AsyncFunctionDef) for node in self.nodes)

    @property
    def has_loop(self) -> bool:
        """Whether anything is repeated by `for` or `while`."""
        return any(isinstance(node, LOOPS + COMPREHENSIONS) for node in self.nodes)

    @cached_property
    def returns_in_loops(self) -> list[int]:
        """The lines of `return` within a loop of the same function."""
        loops = [node for node in self.nodes if isinstance(node, LOOPS)]
        return sorted({inner.lineno for loop in loops for inner in walk_within(loop) if isinstance(inner, ast.Return)})

    @cached_property
    def keeps_values_outside(self) -> bool:
        """Whether anything lives on between two calls of a function: a variable of the module or of a class, an
        argument's default, a cache, or an attribute of a function."""
        for node in self.nodes:
            if isinstance(node, ast.Global | ast.Nonlocal | ast.ClassDef):
                return True
            if isinstance(node, FUNCTIONS) and any(isinstance(value, MUTABLE) for value in list_defaults(node.args)):
                return True
        return bool(self.names & CACHES) or any(
            isinstance(node, ast.Assign | ast.AnnAssign) and not node.col_offset
            and any(isinstance(value, MUTABLE) for value in (node.value, *list_items(node.value)))
            for node in self.nodes
        ) or self.has_function_attribute  # fmt: skip

    @property
    def has_function_attribute(self) -> bool:
        """Whether a function gets an attribute, as in `step.count = 0`."""
        functions = {node.name for node in self.nodes if isinstance(node, ast.FunctionDef)}
        return any(
            isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in functions
            for node in self.nodes
        )

    def has_alias(self, field: str) -> bool:
        """Whether a field of data gets a name without a copy, as in `q = data.qpos`."""
        return any(
            is_field(value, field)
            for node in self.nodes if isinstance(node, ast.Assign | ast.AnnAssign | ast.NamedExpr)
            for value in list_items(node.value)
        )  # fmt: skip

    def has_view(self, *fields: str) -> bool:
        """Whether one of these fields is kept or passed on without a copy: it shares its numbers with data."""
        return any(
            is_field(value, field)
            for node in self.nodes for value in list_kept(node) for field in fields
        )  # fmt: skip

    @property
    def has_shared_name(self) -> bool:
        """Whether one value gets two names, as in `a = b = []` or in `a = b`."""
        return any(
            isinstance(node, ast.Assign) and (len(node.targets) > 1 or isinstance(node.value, ast.Name))
            for node in self.nodes
        )

    def find_write(self, field: str) -> int | None:
        """Returns the line of the last statement that writes an attribute of this name, or into it; None if none does.
        `setattr` counts."""
        lines = [node.lineno for node in self.nodes if isinstance(node, ast.stmt) and writes_field(node, field)]
        return max(lines, default=None)

    def find_call(self, *names: str) -> int | None:
        """Returns the line of the last call of one of these functions or methods; None if there is none."""
        calls = [node for node in self.nodes if isinstance(node, ast.Call)]
        return max((node.lineno for node in calls if read_name(node.func) in names), default=None)

    def find_loop(self, holds: Callable[[ast.AST], bool]) -> int | None:
        """Returns the line of the innermost loop that holds such a node; None if there is none."""
        loops = [node for node in self.nodes if isinstance(node, LOOPS)]
        return max((loop.lineno for loop in loops if any(map(holds, walk_within(loop)))), default=None)

    def find_bound(self, field: str) -> float | None:
        """Returns the number that an attribute of this name must exceed in a comparison: 0 for `x.field > 0`, 1 for
        `> 1` and `>= 2`; None if there is no such comparison."""
        for node in self.nodes:
            if isinstance(node, ast.Compare) and len(node.ops) == 1 and read_name(node.left) == field:
                bound = getattr(node.comparators[0], "value", None)
                if isinstance(bound, int | float) and isinstance(node.ops[0], ast.Gt | ast.GtE):
                    return bound - isinstance(node.ops[0], ast.GtE)
        return None

    def find_middles(self) -> dict[str, int]:
        """Returns the variables that get the middle of two others, such as `mid = (low + high) / 2`, with their lines;
        any half of a sum or difference counts, rightly taken or not."""
        return {
            target.id: node.lineno
            for node in self.nodes if isinstance(node, ast.Assign) and is_half(node.value)
            for target in node.targets if isinstance(target, ast.Name)
        }  # fmt: skip

    @cached_property
    def tests(self) -> dict[int, int]:
        """The line of the innermost `if` around each node, by the node's id; 0 where there is none in its function."""
        tests, left = dict[int, int](), list[tuple[ast.AST, int]]([(self.tree, 0)] if self.tree else [])
        while left:
            node, test = left.pop()
            tests[id(node)] = test
            within = node.lineno if isinstance(node, ast.If) else test
            left += ((child, 0 if isinstance(child, FUNCTIONS) else within) for child in ast.iter_child_nodes(node))
        return tests

    def find_updates(self) -> list[tuple[int, int]]:
        """Returns the statements that give another variable the value of a middle: the line, and the line of the `if`
        around it, 0 where there is none."""
        middles, updates = self.find_middles(), list[tuple[int, int]]()
        for node in self.nodes:
            for target, value in list_pairs(node):
                if isinstance(target, ast.Name) and isinstance(value, ast.Name) and value.id in middles:
                    line = getattr(node, "lineno", 0)
                    if target.id != value.id:
                        updates.append((line, line if has_choice(node) else self.tests.get(id(node), 0)))
        return updates


NO_SCRIPT = ParsedScript()


def walk_within(node: ast.AST) -> Iterator[ast.AST]:
    """Yields the nodes below a node, but not those of functions that are defined there."""
    left = [node]  # no recursion: a sum of a thousand terms is a thousand levels deep
    while left:
        for child in ast.iter_child_nodes(left.pop()):
            if not isinstance(child, FUNCTIONS):
                yield child
                left.append(child)


def read_name(function: ast.expr) -> str:
    """Returns the name of a function or method; empty if it has none."""
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def list_defaults(arguments: ast.arguments) -> list[ast.expr]:
    """Returns the defaults of a function's arguments."""
    return [node for node in (*arguments.defaults, *arguments.kw_defaults) if node is not None]


def list_items(value: ast.expr | None) -> list[ast.expr]:
    """Returns the items of a tuple or list that is written out; else the value itself."""
    if value is None:
        return []
    return list(value.elts) if isinstance(value, ast.Tuple | ast.List) else [value]


def list_kept(node: ast.AST) -> list[ast.expr]:
    """Returns the values that a node gives a name, puts into a list, returns, or passes on."""
    if isinstance(node, ast.Assign | ast.AnnAssign | ast.NamedExpr | ast.Return):
        return list_items(node.value)
    if isinstance(node, ast.Tuple | ast.List):
        return node.elts
    if isinstance(node, ast.Call):
        copies = isinstance(node.func, ast.Attribute) and node.func.attr in COPYING
        return [] if copies else node.args
    return []


def list_pairs(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yields target and value of each assignment in a statement, those of tuples item by item."""
    if not isinstance(node, ast.Assign):
        return
    value = node.value
    for target in node.targets:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.IfExp):
            yield from ((one, part) for part in (value.body, value.orelse) for one, part in pair_up(target, part))
        elif isinstance(target, ast.Tuple):
            yield from pair_up(target, value)
        elif isinstance(value, ast.IfExp):
            yield from ((target, part) for part in (value.body, value.orelse))
        else:
            yield target, value


def pair_up(target: ast.Tuple, value: ast.expr) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yields the items of a tuple of targets, each with its value, where that is a tuple of as many."""
    items = list_items(value)
    if len(items) == len(target.elts):
        yield from zip(target.elts, items, strict=True)


def has_choice(node: ast.AST) -> bool:
    """Whether the value of an assignment depends on a condition, `... if ... else ...`."""
    return isinstance(node, ast.Assign) and isinstance(node.value, ast.IfExp)


def reads_name(value: ast.expr, name: str) -> bool:
    """Whether a value is a variable."""
    return isinstance(value, ast.Name) and value.id == name


def is_field(value: ast.expr, field: str) -> bool:
    """Whether a value is an attribute of this name, or a slice of one, which shares its numbers."""
    if isinstance(value, ast.Subscript) and isinstance(value.slice, ast.Slice):
        value = value.value
    return isinstance(value, ast.Attribute) and value.attr == field


def writes_field(node: ast.stmt, field: str) -> bool:
    """Whether a statement assigns to an attribute of this name, or into it."""
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    for target in targets:
        for item in list_items(target):
            inner = item.value if isinstance(item, ast.Subscript) else item
            if isinstance(inner, ast.Attribute) and inner.attr == field:
                return True
    call = node.value if isinstance(node, ast.Expr) else None
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name) or call.func.id != "setattr":
        return False
    return any(isinstance(arg, ast.Constant) and arg.value == field for arg in call.args)


def is_half(value: ast.expr) -> bool:
    """Whether a value is half of something, of a part of it, or a root: the middle of a bisection."""
    for node in ast.walk(value):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div | ast.Mult | ast.FloorDiv):
            numbers = [side.value for side in (node.left, node.right) if isinstance(side, ast.Constant)]
            if any(number in (2, 0.5) for number in numbers):
                return True
    return False
