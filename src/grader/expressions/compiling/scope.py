"""Which names are visible where, and what each is called in the compiled code. No function can call itself and none
outlives its call, so a declared name is one variable of one Python function. An author's identifier never becomes a
Python name: variables are numbered."""

import ast
from collections.abc import Collection
from dataclasses import dataclass, field
from difflib import get_close_matches

from tree_sitter import Node

from grader.expressions.compiling.syntax import SyntaxRefused, read_text
from grader.expressions.fields import DATA_RESULTS, DATA_STATE, split_names
from grader.expressions.runtime import FUNCTIONS

ROOTS = split_names("model data mj lib sim Math ctx Number Array")
HOSTS = ROOTS | split_names("undefined NaN Infinity value Float64Array") | {path.split(".")[0] for path in FUNCTIONS}
RESERVED = split_names("""
    break case catch class const continue debugger default delete do else enum export extends false finally for
    function if import in instanceof new null return super switch this throw true try typeof var void while with
    yield let static implements interface package private protected public await eval arguments async of get set
    globalThis window self document process require Object Function Symbol Reflect Proxy
""")


NAMES = (
    *(f"data.{name}" for name in sorted(DATA_STATE | DATA_RESULTS | {"time"})),
    *sorted(path for path in FUNCTIONS if "." in path),
)
"""What an author may mean by a name alone: a field of the data, or a function of `Math` or `lib`."""


def suggest(name: str, known: Collection[str]) -> str:
    """Returns what an author may have meant by a name, for the end of a sentence; empty where nothing is near. A name
    alone may lack its root: `qpos` means `data.qpos`."""
    last = name.rpartition(".")[2]
    rooted = [candidate for candidate in known if candidate.rpartition(".")[2] == last and candidate != name]
    near = rooted[:1] or get_close_matches(name, known, n=1, cutoff=0.75)
    return f": did you mean {near[0]}?" if near else ""


@dataclass
class Frame:
    """One Python function of the compiled code: its functions inside, and the outer variables that it assigns."""

    functions: list[ast.stmt] = field(default_factory=list)
    outer: set[str] = field(default_factory=set)


@dataclass
class Binding:
    """A declared name: a variable of a frame, or a function. `ready` once its declaration is past."""

    kind: str
    name: str
    frame: Frame
    ready: bool = False


@dataclass
class Scope:
    """The names of one block, inside those of another."""

    frame: Frame
    outer: "Scope | None" = None
    counter: list[int] = field(default_factory=lambda: [0])
    names: dict[str, Binding] = field(default_factory=dict)
    in_loop: bool = False

    def inner(self, *, in_loop: bool = False) -> "Scope":
        """Returns a block inside this one."""
        return Scope(self.frame, self, self.counter, in_loop=in_loop or self.in_loop)

    def function(self) -> "Scope":
        """Returns the scope of a function inside this one."""
        return Scope(Frame(), self, self.counter)

    def declare(self, node: Node, kind: str, ready: bool = False) -> Binding:
        """Give a name of this block a variable. Raises SyntaxRefused for names that are taken."""
        name = read_text(node)
        if name in HOSTS or name in RESERVED or not name.isascii():
            raise SyntaxRefused(node, f"{name} cannot be the name of a variable")
        known = self.names.get(name)
        if known is not None and not (kind == known.kind == "var"):
            raise SyntaxRefused(node, f"{name} is declared twice")
        if known is None:
            known = self.names[name] = Binding(kind, f"v{self.counter[0]}", self.frame, ready)
            self.counter[0] += 1
        return known

    def find(self, node: Node) -> Binding:
        """The binding of a name that is used. Raises SyntaxRefused where it is unknown, or declared further down."""
        name = read_text(node)
        scope: Scope | None = self
        while scope is not None:
            binding = scope.names.get(name)
            if binding is not None:
                if not binding.ready:
                    raise SyntaxRefused(node, f"{name} is used before it is declared")
                return binding
            scope = scope.outer
        raise SyntaxRefused(node, f"{name} is not known here{suggest(name, NAMES)}")
