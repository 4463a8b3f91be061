"""From text to a syntax tree: tree-sitter's grammar of JavaScript, with the refusals that the grammar leaves out."""

import re
from dataclasses import dataclass

import tree_sitter
import tree_sitter_javascript
from tree_sitter import Node

from grader.expressions.values import in_units, whole_number

LANGUAGE = tree_sitter.Language(tree_sitter_javascript.language())
TEXT_MAX = 10_000
DEPTH_MAX = 40


class Refused(Exception):
    """A text that is not a program of this language; line and column count from 1."""

    def __init__(self, line: int, column: int, why: str) -> None:
        super().__init__(f"line {line}, column {column}: {why}")


@dataclass(frozen=True)
class Source:
    """A parsed text. An expression is parsed inside parentheses, as the browser does: `{` never begins a block."""

    text: str
    root: Node
    shift: int

    def place(self, point: tuple[int, int]) -> tuple[int, int]:
        """Line and column in the author's text, from 1, of a node's start."""
        row, column = point
        lines = self.text.encode().split(b"\n")
        ahead = lines[row][: column - (self.shift if row == 0 else 0)] if row < len(lines) else b""
        return min(row + 1, len(lines)), len(ahead.decode(errors="replace")) + 1

    def refuse(self, node: Node, why: str) -> Refused:
        """The error with the node's place."""
        return Refused(*self.place(node.start_point), why)


def text_of(node: Node) -> str:
    """The source text of a node."""
    return (node.text or b"").decode()


def parts(node: Node) -> list[Node]:
    """The named children, without comments."""
    return [child for child in node.named_children if child.type != "comment"]


def field(node: Node, name: str) -> Node:
    """A child that the grammar promises."""
    child = node.child_by_field_name(name)
    assert child is not None, f"{node.type} without {name}"
    return child


def parse(text: str, kind: str) -> Source:
    """The tree of an expression or of a statement list. Raises Refused."""
    if len(text) > TEXT_MAX:
        raise Refused(1, 1, f"longer than {TEXT_MAX} characters")
    shift = 1 if kind == "expression" else 0
    try:
        raw = (f"({text}\n)" if shift else text).encode()
    except UnicodeEncodeError as error:
        raise Refused(1, error.start + 1, "half a character") from error
    source = Source(text, tree_sitter.Parser(LANGUAGE).parse(raw).root_node, shift)
    if shift and not text.strip():
        raise Refused(1, 1, "an expression is missing")
    if source.root.has_error:
        raise source.refuse(_first_error(source.root), "this is no valid JavaScript")
    _check_tree(source)
    return source


def expression_of(source: Source) -> Node:
    """The one expression inside the parentheses. Raises Refused for none, or more than one."""
    statements = parts(source.root)
    inner = parts(statements[0]) if statements and statements[0].type == "expression_statement" else []
    if len(statements) != 1 or len(inner) != 1 or inner[0].type != "parenthesized_expression":
        raise Refused(1, 1, "one expression is needed here")
    if inner[0].end_byte != len(source.text.encode()) + 3:
        raise Refused(1, 1, "one expression is needed here")
    return parts(inner[0])[0]


def _first_error(node: Node) -> Node:
    """The first place that the grammar could not read."""
    while True:
        if node.is_error or node.is_missing:
            return node
        node = next(child for child in node.children if child.has_error or child.is_missing)


ASSIGNMENTS = ("assignment_expression", "augmented_assignment_expression", "arrow_function")
OPERATIONS = ("binary_expression", "unary_expression", "update_expression")
LISTS = ("array", "arguments", "formal_parameters", "array_pattern")


def _check_tree(source: Source) -> None:
    """Refuse what nests too deep and what JavaScript forbids though its grammar could be read so."""
    stack = [(source.root, 0)]
    while stack:
        node, depth = stack.pop()
        if depth > DEPTH_MAX:
            raise source.refuse(node, f"nested more than {DEPTH_MAX} deep")
        if node.type == "binary_expression":
            _check_mixture(source, node)
        if node.type in LISTS:
            _check_holes(source, node)
        if node.type in OPERATIONS and any(child.type in ASSIGNMENTS for child in node.children):
            raise source.refuse(node, "write parentheses around the assignment")
        stack.extend((child, depth + 1) for child in node.children)


def _check_holes(source: Source, node: Node) -> None:
    """Nothing may be missing between two commas, or before the first."""
    before = "("
    for child in node.children:
        if child.type == "," and before in "([,":
            raise source.refuse(child, "something is missing before this comma")
        before = child.type if child.type != "comment" else before


def _check_mixture(source: Source, node: Node) -> None:
    """`-a ** b` and `a ?? b || c` need parentheses. Source: ECMA-262, early errors."""
    operator = text_of(field(node, "operator"))
    left, right = field(node, "left"), field(node, "right")
    if operator == "**" and left.type == "unary_expression":
        raise source.refuse(node, "write parentheses around the base of **")
    for side in (left, right):
        inner = text_of(field(side, "operator")) if side.type == "binary_expression" else ""
        if (operator == "??" and inner in ("||", "&&")) or (operator in ("||", "&&") and inner == "??"):
            raise source.refuse(node, "write parentheses where ?? meets || or &&")


DECIMAL = re.compile(
    r"(?:(?:0|[1-9](?:_?[0-9])*)(?:\.(?:[0-9](?:_?[0-9])*)?)?|\.[0-9](?:_?[0-9])*)(?:[eE][+-]?[0-9](?:_?[0-9])*)?"
)
RADIX = re.compile(r"0(?:[xX][0-9a-fA-F](?:_?[0-9a-fA-F])*|[oO][0-7](?:_?[0-7])*|[bB][01](?:_?[01])*)")


def number_of(source: Source, node: Node) -> float:
    """The value of a number literal."""
    text = text_of(node)
    if DECIMAL.fullmatch(text):
        return float(text.replace("_", ""))
    if RADIX.fullmatch(text):
        return whole_number(text)
    raise source.refuse(node, f"{text} is not a number that is understood here")


LINE_END = re.compile(r"[\r\n]")
ESCAPED = re.compile(r"\\(?:\r\n|[\s\S])")
SIMPLE_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f", "v": "\v", "0": "\0"}


def string_of(source: Source, node: Node) -> str:
    """The value of a text literal, in UTF-16 code units."""
    if LINE_END.search(ESCAPED.sub("", text_of(node))):
        raise source.refuse(node, "a text in quotes ends on its line")
    pieces = [escape_of(source, child) if child.type == "escape_sequence" else text_of(child) for child in parts(node)]
    return in_units("".join(pieces))


def escape_of(source: Source, node: Node) -> str:
    """The character that an escape sequence means."""
    body = text_of(node)[1:]
    if body in SIMPLE_ESCAPES:
        return SIMPLE_ESCAPES[body]
    if body[0] in "xu" and len(body) > 1:
        code = int(body[1:].strip("{}"), 16)
        if code > 0x10FFFF:
            raise source.refuse(node, "no such character")
        return chr(code)
    if body[0].isdigit() or body[0] in "xu":
        raise source.refuse(node, "this escape is not understood here")
    return "" if body in ("\n", "\r\n", "\r", "\u2028", "\u2029") else body
