"""Chains of members, elements and calls, such as `a.b[0].c()`: a method `_link_x` compiles one link of them."""

import ast
from abc import ABC, abstractmethod
from collections.abc import Callable

from tree_sitter import Node

from grader.expressions.compiling import paths
from grader.expressions.compiling.code import (
    Part,
    Term,
    ValueKind,
    build_constant,
    build_expression,
    build_name,
)
from grader.expressions.compiling.scope import ROOTS, Scope, suggest
from grader.expressions.compiling.syntax import FUNCTIONS as FUNCTION_TYPES
from grader.expressions.compiling.syntax import (
    SyntaxRefused,
    get_field,
    list_parts,
    read_number,
    read_text,
)
from grader.expressions.compiling.terms import CONSTRUCTORS, NO_FUNCTIONS, Terms, find_function_path
from grader.expressions.lib import RECORD_PARTS
from grader.expressions.machine import count_arguments, find_callback
from grader.expressions.methods import CALLBACKS
from grader.expressions.runtime import FUNCTIONS

ARRAY_WRITERS = ("set", "fill", "sort", "reverse")
"""The methods that write into a typed array."""

Build = Callable[[ast.expr], ast.expr]
"""Makes the code of a link such as `.length` or `[0]` of the code of the value before it."""


def is_optional(node: Node) -> bool:
    """Whether this link of a chain is written with `?.`."""
    return node.child_by_field_name("optional_chain") is not None


class Chains(Terms, ABC):
    """Compiles chains beside the terms that they stand in."""

    def at_path(self, node: Node, path: str) -> Term:
        """Returns the value at a path. Raises SyntaxRefused where it names nothing that may be read."""
        if path in paths.CONSTANTS:
            return build_constant(paths.CONSTANTS[path])
        if path in paths.WRITABLE:
            return Term(build_name(self.need("vector", path)))
        if key := paths.ctx_name(node, path):
            self.need("ctx", key)
            return Term(build_expression("ctx[KEY]", KEY=ast.Constant(key)))
        if path not in paths.NUMBERS:
            raise SyntaxRefused(node, f"{path} cannot be read here{suggest(path, paths.READABLE)}")
        kind = paths.NUMBERS[path]
        return Term(
            build_expression("READ()" if kind == "scalar" else "READ", READ=self.need(kind, path)), ValueKind.NUMBER
        )

    def _link_member_expression(self, scope: Scope, node: Node) -> Term | Build:
        path = paths.find_path(node)
        key, owner = read_text(get_field(node, "property")), paths.find_path(get_field(node, "object"))
        if path is not None and (key != "length" or owner in ROOTS):
            return self.at_path(node, path)
        if key not in RECORD_PARTS and key != "length":
            raise SyntaxRefused(get_field(node, "property"), f".{key} is not available")
        if path is not None and owner in paths.WRITABLE:
            return Term(build_name(self.need("size", owner or "")), ValueKind.NUMBER)
        return lambda value: build_expression("member(V, KEY)", V=value, KEY=ast.Constant(key))

    def _link_subscript_expression(self, scope: Scope, node: Node) -> Term | Build:
        path = self._field_of(node)
        if path in paths.WRITABLE and (index := get_field(node, "index")).type == "number":
            self.elements.append((path or "", read_number(index), node.start_point))
        if path == "ctx":
            return self.located(node, "read_named(ctx, KEY)", KEY=self.value_of(scope, get_field(node, "index")))
        if path is not None and not is_optional(node):
            return self._element(node, path, self.need("vector", path), self.term(scope, get_field(node, "index")))
        return lambda value: build_expression(
            "read_index(V, INDEX)", V=value, INDEX=self.value_of(scope, get_field(node, "index"))
        )

    def _field_of(self, node: Node) -> str | None:
        """The path of the field whose element a subscript names, if it is one, or `ctx`, which takes names, too."""
        path = paths.find_path(get_field(node, "object"))
        if path == "ctx":
            return path
        if path in ROOTS:
            raise SyntaxRefused(node, "square brackets take the number of an element; name a field with a dot")
        if get_field(node, "index").type in ("string", "template_string"):
            raise SyntaxRefused(get_field(node, "index"), "square brackets take the number of an element")
        return path if path in paths.WRITABLE else None

    def _element(self, node: Node, path: str | None, array: Part, index: Term) -> Term:
        """Returns an element of an array; `path` is the array's where it is a field."""
        if path is None or index.kind is not ValueKind.NUMBER or not paths.holds_floats(path):
            return self.located(node, "read_index(V, INDEX)", V=array, INDEX=index.code)
        view = self.need("view", path)
        known = index.code.value if isinstance(index.code, ast.Constant) else None
        if isinstance(known, float) and known >= 0 and known.is_integer():
            place, size = ast.Constant(int(known)), self.need("size", path)
            element = build_expression(
                "VIEW[KEY] if INDEX < SIZE else undefined", VIEW=view, KEY=place, INDEX=index.code, SIZE=size
            )
        else:
            (first, key), at = self.held(index.code), self.need("positions", path)
            element = build_expression(
                "VIEW[AT[KEY]] if FIRST in AT else undefined", VIEW=view, AT=at, KEY=key, FIRST=first
            )
        return Term(element, ValueKind.ELEMENT)

    def _term_member_expression(
        self, scope: Scope, node: Node, rest: Callable[[Term], Term] = lambda term: term
    ) -> Term:
        """Returns the `rest` of a chain after `node`: all of it is undefined where a `?.` finds null or undefined."""
        compiler: Callable[[Scope, Node], Term | Build] = getattr(self, f"_link_{node.type}", self.term)
        compiled = compiler(scope, node)
        if isinstance(compiled, Term):
            return rest(compiled)
        link = get_field(node, "function") if node.type == "call_expression" else node

        def follow(before: Term) -> Term:
            optional = is_optional(link)
            first, again = self.held(before.code) if optional else (before.code, "")
            term = Term(compiled(build_name(again) if optional else first))
            self.at(node, term.code)
            term = rest(term)
            if not optional:
                return term
            text = "undefined if FIRST is None or V is undefined else REST"
            return Term(build_expression(text, FIRST=first, V=again, REST=term.code))

        return self._term_member_expression(scope, get_field(link, "object"), follow)

    _term_subscript_expression = _term_call_expression = _term_member_expression

    # Calls

    def _link_call_expression(self, scope: Scope, node: Node) -> Term | Build:
        function, arguments = get_field(node, "function"), get_field(node, "arguments")
        if arguments.type != "arguments":
            raise SyntaxRefused(node, "tagged templates are not part of the language of labs")
        args, path = list_parts(arguments), find_function_path(function)
        if path is not None and not is_optional(node):
            return self._host_call(scope, node, path, args)
        if function.type == "identifier":
            called = self.function(scope, function)
            return self.located(node, "F(ITEMS)", F=called, ITEMS=self.items(scope, args))
        if (inside := self._unwrapped(function)).type in FUNCTION_TYPES:
            called = self.arrow(scope, inside)
            return self.located(node, "F(ITEMS)", F=called, ITEMS=self.items(scope, args))
        if function.type != "member_expression":
            raise SyntaxRefused(node, "only functions that have a name, or stand here themselves, can be called")
        return self._method_call(scope, node, function, args)

    def _unwrapped(self, node: Node) -> Node:
        """What stands inside parentheses."""
        while node.type == "parenthesized_expression":
            node = list_parts(node)[0]
        return node

    def _host_call(self, scope: Scope, node: Node, path: str, args: list[Node]) -> Term:
        function = FUNCTIONS[path]
        if tuple(read_text(arg) for arg in args[: len(function.takes)]) != function.takes:
            raise SyntaxRefused(
                node, f"{read_text(get_field(node, 'function'))} begins with {', '.join(function.takes)}"
            )
        rest, count = args[len(function.takes) :], count_arguments(function.numeric) if function.numeric else None
        if function.numeric and len(rest) <= (count or len(rest)) and not any(a.type == "spread_element" for a in rest):
            numbers = [self.number(self.term(scope, arg)) for arg in rest]
            numbers += [build_name("nan")] * ((count or 0) - len(numbers))
            text, called = "F(NUMBERS) if tick(machine) else 0.0", self.need("numeric", path)
            return self.located(node, text, ValueKind.NUMBER, F=called, NUMBERS=numbers)
        return self._host(scope, node, path, rest)

    def _host(self, scope: Scope, node: Node, path: str, args: list[Node]) -> Term:
        given = self.arguments(scope, node, args, find_callback(FUNCTIONS[path].call))
        return self.located(node, "host(machine, F, [GIVEN])", F=self.need("function", path), GIVEN=given)

    def arguments(
        self, scope: Scope, node: Node, args: list[Node], callback: tuple[int, bool] | None
    ) -> list[ast.expr]:
        """The arguments of a call, of which `callback` says the index of a function and whether it must be there."""
        at, needed = callback or (len(args), False)
        if needed and len(args) <= at:
            raise SyntaxRefused(node, "a function is needed here, such as x => 2 * x")
        called = [build_name(self.function(scope, arg)) for arg in args[at : at + 1]]
        return [*self.items(scope, args[:at]), *called, *self.items(scope, args[at + 1 :])]

    def _method_call(self, scope: Scope, node: Node, function: Node, args: list[Node]) -> Build:
        method, path = read_text(get_field(function, "property")), paths.find_path(get_field(function, "object"))
        if method not in CALLBACKS or path in ROOTS:
            name = read_text(function)[:60]
            raise SyntaxRefused(function, f"{name}() is not available{suggest(name, FUNCTIONS.keys())}")
        if method in ARRAY_WRITERS and paths.WRITABLE.get(path) is False:
            raise SyntaxRefused(node, f"{path} can only be read")
        self.writes |= method in ARRAY_WRITERS

        def build(value: ast.expr) -> ast.expr:
            given = self.arguments(scope, node, args, CALLBACKS[method])
            return build_expression(
                "method(machine, V, METHOD, [GIVEN])", V=value, METHOD=ast.Constant(method), GIVEN=given
            )

        return build

    def function(self, scope: Scope, node: Node) -> str:
        """The function that an argument is: written there, or the name of one. Raises SyntaxRefused for others."""
        if node.type in FUNCTION_TYPES:
            return self.arrow(scope, node)
        path = find_function_path(node)
        if path is not None and not FUNCTIONS[path].takes:
            return self.need("callback", path)
        if node.type != "identifier":
            raise SyntaxRefused(node, "a function is needed here, such as x => 2 * x")
        text = read_text(node)
        if text in CONSTRUCTORS:
            raise SyntaxRefused(node, f"write new {text}(...)")
        if text in NO_FUNCTIONS or scope.find(node).kind != "function":
            raise SyntaxRefused(node, f"{text} is no function")
        return scope.find(node).name

    @abstractmethod
    def arrow(self, scope: Scope, node: Node) -> str:
        """Returns the name of the Python function that a function becomes; compiled with the statements."""

    def _term_new_expression(self, scope: Scope, node: Node) -> Term:
        """`new Array(n).fill(x)` and `new Float64Array(n)`; nothing else is constructed."""
        constructor, arguments = read_text(get_field(node, "constructor")), node.child_by_field_name("arguments")
        args, parent = list_parts(arguments) if arguments is not None else [], node.parent
        filled = parent is not None and parent.type == "member_expression" and read_text(parent).endswith("fill")
        sized = len(args) == 1 and args[0].type != "spread_element"
        if constructor == "Float64Array" or (constructor == "Array" and sized and filled):
            return self._host(scope, node, f"new {constructor}", args)
        raise SyntaxRefused(node, "only new Array(n).fill(x) and new Float64Array(n) are available")
