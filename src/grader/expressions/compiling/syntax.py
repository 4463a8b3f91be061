"""From text to a syntax tree: tree-sitter's grammar of JavaScript, with the refusals that the grammar leaves out."""

import re
from dataclasses import dataclass
from typing import Literal

import tree_sitter
import tree_sitter_javascript
from tree_sitter import Node

from grader.expressions.values import text_to_number, to_units

LANGUAGE = tree_sitter.Language(tree_sitter_javascript.language())
TEXT_MAX = 10_000
DEPTH_MAX = 40
START = (0, 0)

ProgramKind = Literal["expression", "statement"]


class SyntaxRefused(Exception):
    """A text is not a program of this language; `point` is the row and column [bytes] in the parsed text, from 0."""

    def __init__(self, at: Node | tuple[int, int], why: str) -> None:
        self.point: tuple[int, int] = at.start_point if isinstance(at, Node) else at
        super().__init__(why)


@dataclass(frozen=True)
class Source:
    """A text. An expression is parsed inside parentheses, as the browser does: `{` never begins a block."""

    text: str
    kind: ProgramKind

    def placed(self, point: tuple[int, int], why: str) -> str:
        """The reason, behind the line and column in the author's text, from 1, of a point in the parsed text."""
        row, column = point
        lines = self.text.encode("utf-8", "surrogatepass").split(b"\n")
        ahead = lines[row][: max(0, column - (self._shift if row == 0 else 0))] if row < len(lines) else b""
        return f"line {min(row + 1, len(lines))}, column {len(ahead.decode(errors='replace')) + 1}: {why}"

    def tree(self) -> Node:
        """Returns the node of the expression, or of the list of statements. Raises SyntaxRefused."""
        if len(self.text) > TEXT_MAX:
            raise SyntaxRefused(START, f"longer than {TEXT_MAX} characters")
        try:
            raw = (f"({self.text}\n)" if self._shift else self.text).encode()
        except UnicodeEncodeError as error:
            raise SyntaxRefused((0, error.start), "half a character") from error
        if self._shift and not self.text.strip():
            raise SyntaxRefused(START, "an expression is missing")
        root = tree_sitter.Parser(LANGUAGE).parse(raw).root_node
        if root.has_error:
            raise SyntaxRefused(_find_error(root), "this is no valid JavaScript")
        _check_tree(root)
        return _find_expression(root, len(raw)) if self._shift else root

    @property
    def _shift(self) -> int:
        return 1 if self.kind == "expression" else 0


def read_text(node: Node) -> str:
    """Returns the source text of a node."""
    return (node.text or b"").decode()


def list_parts(node: Node) -> list[Node]:
    """Returns the named children, without comments."""
    return [child for child in node.named_children if child.type != "comment"]


def get_field(node: Node, name: str) -> Node:
    """Returns a child that the grammar promises."""
    child = node.child_by_field_name(name)
    assert child is not None, f"{node.type} without {name}"
    return child


def _find_expression(root: Node, length: int) -> Node:
    """Returns the one expression inside the parentheses of the text. Raises SyntaxRefused for none, or several."""
    statements = list_parts(root)
    inner = list_parts(statements[0]) if statements and statements[0].type == "expression_statement" else []
    alone = len(statements) == len(inner) == 1 and inner[0].type == "parenthesized_expression"
    if not alone or inner[0].end_byte != length:
        raise SyntaxRefused(START, "one expression is needed here")
    return list_parts(inner[0])[0]


def _find_error(node: Node) -> Node:
    """Returns the first place that the grammar could not read."""
    while True:
        if node.is_error or node.is_missing:
            return node
        node = next(child for child in node.children if child.has_error or child.is_missing)


FUNCTIONS = ("arrow_function", "function_expression")
"""A function that is written where it is used."""

ASSIGNMENTS = ("assignment_expression", "augmented_assignment_expression", "arrow_function")
OPERATIONS = ("binary_expression", "unary_expression", "update_expression")
LISTS = ("array", "arguments", "formal_parameters", "array_pattern")


def _check_tree(root: Node) -> None:
    """Refuse what nests too deep and what JavaScript forbids though its grammar could be read so."""
    stack = [(root, 0)]
    while stack:
        node, depth = stack.pop()
        if depth > DEPTH_MAX:
            raise SyntaxRefused(node, f"nested more than {DEPTH_MAX} deep")
        if node.type == "binary_expression":
            _check_mixture(node)
        if node.type in LISTS:
            _check_holes(node)
        if node.type in OPERATIONS and any(child.type in ASSIGNMENTS for child in node.children):
            raise SyntaxRefused(node, "write parentheses around the assignment")
        stack.extend((child, depth + 1) for child in node.children)


def _check_holes(node: Node) -> None:
    """Nothing may be missing between two commas, or before the first."""
    before = "("
    for child in node.children:
        if child.type == "," and before in "([,":
            raise SyntaxRefused(child, "something is missing before this comma")
        before = child.type if child.type != "comment" else before


def _check_mixture(node: Node) -> None:
    """`-a ** b` and `a ?? b || c` need parentheses. Source: ECMA-262, early errors."""
    operator = read_text(get_field(node, "operator"))
    left, right = get_field(node, "left"), get_field(node, "right")
    if operator == "**" and left.type == "unary_expression":
        raise SyntaxRefused(node, "write parentheses around the base of **")
    for side in (left, right):
        inner = read_text(get_field(side, "operator")) if side.type == "binary_expression" else ""
        if (operator == "??" and inner in ("||", "&&")) or (operator in ("||", "&&") and inner == "??"):
            raise SyntaxRefused(node, "write parentheses where ?? meets || or &&")


def read_number(node: Node) -> float:
    """Returns the value of a number literal."""
    text = read_text(node)
    if text.endswith("n") or re.match("0[0-9_]", text):
        raise SyntaxRefused(node, f"{text} is not a number that is understood here")
    return text_to_number(text.replace("_", ""))


LINE_END = re.compile(r"[\r\n]")
ESCAPED = re.compile(r"\\(?:\r\n|[\s\S])")
SIMPLE_ESCAPES = {"n": "\n", "t": "\t", "r": "\r", "b": "\b", "f": "\f", "v": "\v", "0": "\0"}


def read_string(node: Node) -> str:
    """Returns the value of a text literal, in UTF-16 code units."""
    if LINE_END.search(ESCAPED.sub("", read_text(node))):
        raise SyntaxRefused(node, "a text in quotes ends on its line")
    pieces = [read_escape(child) if child.type == "escape_sequence" else read_text(child) for child in list_parts(node)]
    return to_units("".join(pieces))


def read_escape(node: Node) -> str:
    """Returns the character that an escape sequence means."""
    body = read_text(node)[1:]
    if body in SIMPLE_ESCAPES:
        return SIMPLE_ESCAPES[body]
    if body[0] in "xu" and len(body) > 1:
        code = int(body[1:].strip("{}"), 16)
        if code > 0x10FFFF:
            raise SyntaxRefused(node, "no such character")
        return chr(code)
    if body[0].isdigit() or body[0] in "xu":
        raise SyntaxRefused(node, "this escape is not understood here")
    return "" if body in ("\n", "\r\n", "\r", "\u2028", "\u2029") else body
