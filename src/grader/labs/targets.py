"""Members, elements and what can be assigned."""

from collections.abc import Callable
from dataclasses import dataclass

from tree_sitter import Node

from grader.labs import paths
from grader.labs.dispatch import compile_term
from grader.labs.library import RECORD_PARTS
from grader.labs.machine import Machine
from grader.labs.scope import Code, Scope
from grader.labs.syntax import field, parts, text_of
from grader.labs.values import (
    UNDEFINED,
    Record,
    Trouble,
    Value,
    Vector,
    to_boolean,
    to_string,
)

MEMBERS = RECORD_PARTS | {"length"}


class ShortCircuit(Exception):
    """`?.` met undefined: the rest of the chain is skipped."""


def is_optional(node: Node) -> bool:
    """Whether this link of a chain is written with `?.`."""
    return node.child_by_field_name("optional_chain") is not None


def whole_chain(node: Node, code: Code) -> Code:
    """The code of a chain; undefined where `?.` cut it short. Only the last link of a chain with `?.` catches."""
    parent = node.parent
    links = ("member_expression", "subscript_expression", "call_expression")
    if parent is not None and parent.type in links and parent.children[0] == node:
        return code
    link: Node | None = node
    while link is not None and link.type in links:
        if is_optional(link):
            return _guarded(code)
        link = link.child_by_field_name("function") or link.child_by_field_name("object")
    return code


def _guarded(code: Code) -> Code:
    def run(m: Machine) -> Value:
        try:
            return code(m)
        except ShortCircuit:
            return UNDEFINED

    return run


def length_of(value: Value) -> Value:
    """`value.length`."""
    if isinstance(value, str | list):
        return float(len(value))
    return float(value.array.size) if isinstance(value, Vector) else UNDEFINED


def part_of(value: Value, name: str) -> Value:
    """A named part of a record; undefined for other values."""
    return value.parts.get(name, UNDEFINED) if isinstance(value, Record) else UNDEFINED


def check_subscript(scope: Scope, node: Node) -> None:
    """Fields are named with a dot; square brackets take numbers."""
    if paths.path_of(field(node, "object")) in {(root,) for root in paths.ROOTS}:
        raise scope.refuse(node, "square brackets take the number of an element; name a field with a dot")
    if field(node, "index").type in ("string", "template_string"):
        raise scope.refuse(field(node, "index"), "square brackets take the number of an element")


def _position(index: Value) -> int | None:
    """The element that an index means; None for numbers that mean none, such as 0.5 or NaN."""
    if isinstance(index, str) and index.isascii() and index.isdigit() and str(int(index[:9])) == index:
        return int(index)
    if not isinstance(index, float):
        raise Trouble(f"an element is named by a whole number, not by {to_string(index)[:40]}")
    return int(index) if index.is_integer() else None


def read_index(value: Value, index: Value) -> Value:
    """`value[index]`: undefined out of range."""
    if type(value) is Vector and type(index) is float and index.is_integer():
        return value.read(int(index))
    if value is None or value is UNDEFINED:
        raise Trouble(f"{to_string(value)} has no elements")
    position = _position(index)
    if position is None or not isinstance(value, str | list | Vector):
        return UNDEFINED
    if isinstance(value, Vector):
        return value.read(position)
    return value[position] if 0 <= position < len(value) else UNDEFINED


def write_index(value: Value, index: Value, new: Value) -> None:
    """`value[index] = new`: past the end is an error, for arrays too."""
    if isinstance(value, Vector):
        position = _position(index)
        value.write(-1 if position is None else position, new)
        return
    if not isinstance(value, list):
        raise Trouble(f"elements of {to_string(value)[:40]} cannot be assigned")
    position = _position(index)
    if position is None or not 0 <= position < len(value):
        raise Trouble(f"index {to_string(index)} is outside the array, which has {len(value)} elements")
    value[position] = new


@dataclass(frozen=True)
class Target:
    """What stands left of `=`. `locate` is evaluated once, then read and written."""

    locate: Callable[[Machine], tuple[Value, Value]]
    read: Callable[[Machine, tuple[Value, Value]], Value]
    write: Callable[[Machine, tuple[Value, Value], Value], None]

    def assign(self, m: Machine, right: Code) -> Value:
        """`target = right`."""
        place = self.locate(m)
        value = right(m)
        self.write(m, place, value)
        return value

    def update(self, m: Machine, combine: Callable[[Machine, Value], Value]) -> tuple[Value, Value]:
        """`target op= ...`: the old and the new value."""
        place = self.locate(m)
        old = self.read(m, place)
        new = combine(m, old)
        self.write(m, place, new)
        return old, new

    def assign_if(self, m: Machine, operator: str, right: Code) -> Value:
        """`target ||= right` and its kin: assigns only where the operator would look at the right side."""
        place = self.locate(m)
        old = self.read(m, place)
        empty = old is None or old is UNDEFINED
        if not {"&&": to_boolean(old), "||": not to_boolean(old), "??": empty}[operator]:
            return old
        value = right(m)
        self.write(m, place, value)
        return value


def _nowhere(m: Machine) -> tuple[Value, Value]:
    return UNDEFINED, UNDEFINED


def compile_target(scope: Scope, node: Node) -> Target:
    """What an assignment writes to. Raises Refused where that is nothing that may be written."""
    if node.type == "parenthesized_expression":
        return compile_target(scope, parts(node)[0])
    if node.type == "subscript_expression" and not is_optional(node):
        return _element(scope, node)
    path = paths.path_of(node)
    if node.type == "member_expression" and path is not None:
        write, read = paths.store(scope, node, path), paths.load(scope, node, path)
        return Target(_nowhere, lambda m, _: read(m), lambda m, _, value: write(m, value))
    if node.type != "identifier" or text_of(node) in ("value", "undefined", *paths.ROOTS):
        raise scope.refuse(node, "this cannot be assigned")
    binding = scope.find(node)
    if binding.kind not in ("let", "var", "parameter"):
        raise scope.refuse(node, f"{text_of(node)} is constant")
    slot = binding.slot

    def write_slot(m: Machine, _: tuple[Value, Value], value: Value) -> None:
        m.slots[slot] = value

    return Target(_nowhere, lambda m, _: m.slots[slot], write_slot)


def _element(scope: Scope, node: Node) -> Target:
    check_subscript(scope, node)
    path = paths.path_of(field(node, "object"))
    if path is not None and paths.vector_is_writable(path) is False:
        raise scope.refuse(node, f"{'.'.join(path)} can only be read")
    array, index = compile_term(scope, field(node, "object")), compile_term(scope, field(node, "index"))
    return Target(
        lambda m: (array(m), index(m)),
        lambda m, place: read_index(*place),
        lambda m, place, value: write_index(*place, value),
    )
