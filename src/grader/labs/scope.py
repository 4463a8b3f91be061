"""Which names are visible where, and in which slot of the machine each value lives.

No function can call itself and none outlives its call, so every variable has one slot for the whole program.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tree_sitter import Node

from grader.labs.machine import Machine
from grader.labs.syntax import Refused, Source, text_of
from grader.labs.values import Value

Code = Callable[[Machine], Value]
Maker = Callable[[Machine], Callable[..., Value]]
"""Makes, for one run, the Python function that an arrow function or a named function is."""

HOSTS = frozenset(
    [
        "model",
        "data",
        "mj",
        "ctx",
        "lib",
        "Math",
        "value",
        "Number",
        "Array",
        "Float64Array",
        "String",
        "Boolean",
        "isNaN",
        "isFinite",
        "Infinity",
        "NaN",
        "undefined",
    ]
)
RESERVED = frozenset(
    [
        "break",
        "case",
        "catch",
        "class",
        "const",
        "continue",
        "debugger",
        "default",
        "delete",
        "do",
        "else",
        "enum",
        "export",
        "extends",
        "false",
        "finally",
        "for",
        "function",
        "if",
        "import",
        "in",
        "instanceof",
        "new",
        "null",
        "return",
        "super",
        "switch",
        "this",
        "throw",
        "true",
        "try",
        "typeof",
        "var",
        "void",
        "while",
        "with",
        "yield",
        "let",
        "static",
        "implements",
        "interface",
        "package",
        "private",
        "protected",
        "public",
        "await",
        "eval",
        "arguments",
        "async",
        "of",
        "get",
        "set",
        "globalThis",
        "window",
        "self",
        "document",
        "process",
        "require",
        "Object",
        "Function",
        "Symbol",
        "Reflect",
        "Proxy",
    ]
)


@dataclass
class Binding:
    """A declared name: a variable in a slot, or a function known by name. `ready` once its declaration is past."""

    kind: str
    slot: int = -1
    maker: Maker | None = None
    ready: bool = False


@dataclass
class Scope:
    """The names of one block, inside those of another."""

    source: Source
    outer: "Scope | None" = None
    counter: list[int] = field(default_factory=lambda: [0])
    names: dict[str, Binding] = field(default_factory=dict)
    in_loop: bool = False
    in_function: bool = False

    def inner(self, **changes: Any) -> "Scope":
        """A block inside this one."""
        loop, function = changes.get("in_loop", self.in_loop), changes.get("in_function", self.in_function)
        return Scope(self.source, self, self.counter, {}, loop, function)

    def declare(self, node: Node, kind: str, ready: bool = False) -> Binding:
        """Give a name of this block a slot. Raises Refused for names that are taken."""
        name = text_of(node)
        if name in HOSTS or name in RESERVED or not name.isascii():
            raise self.refuse(node, f"{name} cannot be the name of a variable")
        known = self.names.get(name)
        if known is not None and not (kind == known.kind == "var"):
            raise self.refuse(node, f"{name} is declared twice")
        if known is None:
            known = self.names[name] = Binding(kind, self.counter[0], ready=ready)
            self.counter[0] += 1
        return known

    def find(self, node: Node) -> Binding:
        """The binding of a name that is used. Raises Refused where there is none yet."""
        name = text_of(node)
        scope: Scope | None = self
        while scope is not None:
            binding = scope.names.get(name)
            if binding is not None:
                if not binding.ready:
                    raise self.refuse(node, f"{name} is used before it is declared")
                return binding
            scope = scope.outer
        raise self.refuse(node, f"{name} is not known here")

    def refuse(self, node: Node, why: str) -> Refused:
        """The error that tells where and why."""
        return self.source.refuse(node, why)
