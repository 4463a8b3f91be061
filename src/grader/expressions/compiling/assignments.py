"""Assignments: what they write to, and how it is read before where it is changed."""

import ast
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from tree_sitter import Node

from grader.expressions import fields
from grader.expressions.compiling import paths
from grader.expressions.compiling.chains import Chains, is_optional
from grader.expressions.compiling.code import (
    Term,
    ValueKind,
    build_constant,
    build_expression,
    build_name,
    build_sequence,
)
from grader.expressions.compiling.scope import Scope
from grader.expressions.compiling.syntax import (
    SyntaxRefused,
    get_field,
    list_parts,
    read_text,
)
from grader.expressions.compiling.terms import BINARY, LOGICAL, NO_FUNCTIONS, read_operator


class Place(NamedTuple):
    """What an assignment writes to. `begin` is evaluated first; `read` and `write` make code that follows it."""

    read: Callable[[], Term]
    write: Callable[[Term], ast.expr]
    begin: tuple[ast.expr, ...] = ()


class Assignments(Chains):
    """Compiles assignments beside the terms that they stand in."""

    def place(self, scope: Scope, node: Node, again: bool) -> Place:
        """What an assignment writes to, which is read `again` or not. Raises SyntaxRefused if it cannot be."""
        if node.type == "parenthesized_expression":
            return self.place(scope, list_parts(node)[0], again)
        if node.type == "subscript_expression" and not is_optional(node):
            return self._element_place(scope, node, again)
        path = paths.find_path(node)
        if node.type == "member_expression" and path is not None:
            return self._path_place(node, path)
        if node.type != "identifier" or read_text(node) in NO_FUNCTIONS:
            raise SyntaxRefused(node, "this cannot be assigned")
        binding = scope.find(node)
        if binding.kind not in ("let", "var", "parameter"):
            raise SyntaxRefused(node, f"{read_text(node)} is constant")

        def write(new: Term) -> ast.expr:
            self.stored(scope, binding, new)
            return build_expression("(V := NEW)", V=binding.name, NEW=new.code)

        return Place(lambda: self.variable(binding), write)

    def _path_place(self, node: Node, path: str) -> Place:
        if paths.NUMBERS.get(path) == "scalar" and path.removeprefix("data.") not in fields.DATA_COUNTS:
            template, place = "PLACE(NEW)", build_name(self.need("write scalar", path))
        elif key := paths.ctx_name(node, path):
            template, place = "put(ctx, PLACE, NEW)", ast.Constant(key)
        else:
            cure = "is an array: assign its elements, or use .set() or .fill()"
            raise SyntaxRefused(node, f"{path} {cure if path in paths.WRITABLE else 'cannot be assigned'}")
        self.at_path(node, path)
        return Place(
            partial(self.at_path, node, path), lambda new: build_expression(template, PLACE=place, NEW=new.code)
        )

    def _element_place(self, scope: Scope, node: Node, again: bool) -> Place:
        path = self._field_of(node)
        if path is not None and paths.WRITABLE.get(path) is False:
            raise SyntaxRefused(node, f"{path} can only be read")
        index = self.term(scope, get_field(node, "index"))
        array = Term(build_name("ctx")) if path == "ctx" else self.term(scope, get_field(node, "object"))
        begin: list[ast.expr] = []
        for term in (array, index) if again else ():
            if not isinstance(term.code, ast.Constant) and (path is None or term is index):
                first, kept = self.held(term.code, lasts=True)
                begin.append(first)
                term.kind, term.code = term.stored_kind, build_name(kept)

        def write(new: Term) -> ast.expr:
            if path == "ctx":
                return build_expression("write_named(ctx, INDEX, NEW)", INDEX=index.code, NEW=new.code)
            if path is None:
                return build_expression("write_index(V, INDEX, NEW)", V=array.code, INDEX=index.code, NEW=new.code)
            return build_expression("WRITE(INDEX, NEW)", WRITE=self.need("write", path), INDEX=index.code, NEW=new.code)

        def read() -> Term:
            if path == "ctx":
                return self.located(node, "read_named(ctx, INDEX)", INDEX=index.code)
            return self._element(node, path, array.code, index)

        return Place(read, write, tuple(begin))

    def written(self, node: Node, place: Place, new: Term) -> Term:
        """Returns the assignment of a value, which is the value of the assignment."""
        self.writes = True
        term = Term(place.write(new), new.stored_kind)
        self.at(node, term.code)
        return term

    def _term_assignment_expression(self, scope: Scope, node: Node) -> Term:
        place = self.place(scope, get_field(node, "left"), again=False)
        return self.written(node, place, self.term(scope, get_field(node, "right")))

    def _term_augmented_assignment_expression(self, scope: Scope, node: Node) -> Term:
        place = self.place(scope, get_field(node, "left"), again=True)
        operator, right = read_operator(node, BINARY)[:-1], self.term(scope, get_field(node, "right"))
        if operator in LOGICAL:
            term = self.chosen(operator, place.read(), self.written(node, place, right))
        else:
            term = self.written(node, place, self.combined(node, operator, place.read(), right))
        return Term(build_sequence(*place.begin, term.code), term.kind)

    def update(self, scope: Scope, node: Node, old_value: bool) -> Term:
        """`place++` or `--place`: the old or the new value."""
        place = self.place(scope, get_field(node, "argument"), again=True)
        old, kept = self.number(place.read()), ""
        if old_value:
            old, kept = self.held(old, lasts=True)
        new = self.combined(
            node, read_text(get_field(node, "operator"))[0], Term(old, ValueKind.NUMBER), build_constant(1.0)
        )
        written = self.written(node, place, new).code
        return Term(build_sequence(*place.begin, written, *([build_name(kept)] if kept else [])), ValueKind.NUMBER)

    def _term_update_expression(self, scope: Scope, node: Node) -> Term:
        return self.update(scope, node, old_value=node.children[0].type not in ("++", "--"))
