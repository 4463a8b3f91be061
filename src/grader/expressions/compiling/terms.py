"""Expressions: each node of the tree becomes a Python expression, which checks only types that are not known. A method
`_term_x` compiles the grammar's node type `x`; `_link_x` a link of a chain such as `a.b[0].c()`."""

import ast
import re
from collections.abc import Callable, Collection
from typing import Any

from tree_sitter import Node

from grader.expressions.compiling import paths
from grader.expressions.compiling.code import (
    Part,
    Term,
    ValueKind,
    build_constant,
    build_expression,
    build_name,
    build_sequence,
    join_kinds,
)
from grader.expressions.compiling.scope import ROOTS, Binding, Scope
from grader.expressions.compiling.syntax import (
    SyntaxRefused,
    get_field,
    list_parts,
    read_escape,
    read_number,
    read_string,
    read_text,
)
from grader.expressions.runtime import FUNCTIONS, OPERATORS
from grader.expressions.values import to_units

COMPARISONS = {"<": "<", "<=": "<=", ">": ">", ">=": ">=", "===": "==", "!==": "!=", "==": "==", "!=": "!="}
PYTHON = {**COMPARISONS, "+": "+", "-": "-", "*": "*"}
"""The operators that mean for floats what this one means in Python."""

LOGICAL = {
    "&&": "RIGHT if TRUE else LEFT",
    "||": "LEFT if TRUE else RIGHT",
    "??": "RIGHT if FIRST is None or LEFT is undefined else LEFT",
}
"""The operators whose right side may not be evaluated."""

BINARY = {*OPERATORS, *PYTHON, *LOGICAL}
UNARY = {
    "-": ("-NUMBER", ValueKind.NUMBER),
    "+": ("NUMBER", ValueKind.NUMBER),
    "~": ("complement(NUMBER)", ValueKind.NUMBER),
    "!": ("not TRUTH", ValueKind.BOOLEAN),
    "typeof": ("type_name(VALUE)", ValueKind.ANY),
}
"""The operators of one value: their code, and what it gives."""

LITERALS: dict[str, Callable[[Node], float | bool | str | None]] = {
    "number": read_number,
    "string": read_string,
    "true": lambda _: True,
    "false": lambda _: False,
    "null": lambda _: None,
}
"""The values of the grammar's literals."""

NAMED = {"undefined": "undefined", "value": "given"}
"""The names, in compiled code, of values that every program has."""

CONSTRUCTORS = ("Array", "Float64Array")
NO_FUNCTIONS = ROOTS | NAMED.keys() | paths.CONSTANTS.keys()


def find_function_path(node: Node) -> str | None:
    """Returns the path of the host's function of this name, if it is one."""
    path = read_text(node) if node.type == "identifier" else paths.find_path(node)
    return path if path in FUNCTIONS else None


def read_operator(node: Node, known: Collection[str]) -> str:
    """Returns the operator of a node. Raises SyntaxRefused for one that is not known."""
    operator = read_text(get_field(node, "operator"))
    if operator.removesuffix("=" if node.type.startswith("augmented") else "") not in known:
        raise SyntaxRefused(node, f"the operator {operator} is not part of the language of labs")
    return operator


class Terms:
    """Compiles the expressions of one text. `kinds` is what is assumed of each variable (None: nothing),
    `variable_kinds` what is assigned to it; `needs` names what a machine binds before the program runs; `places` are
    the positions of errors, by line of the compiled code; `elements` are those of fields that the text names by a
    number, each with its position; `writes` says whether something is assigned or an array changed."""

    def __init__(self, kinds: dict[str, ValueKind] | None) -> None:
        self.kinds = kinds
        self.variable_kinds: dict[str, ValueKind] = {}
        self.needs: dict[tuple[str, str], str] = {}
        self.places: list[tuple[int, int]] = []
        self.elements: list[tuple[str, float, tuple[int, int]]] = []
        self.temporaries = 0
        self.writes = False

    def need(self, kind: str, path: str) -> str:
        """Returns the variable for what a machine binds for the path; the kinds are those of `paths.BINDERS`."""
        return self.needs.setdefault((kind, path), f"n{len(self.needs)}")

    def temporary(self, letter: str = "t") -> str:
        """Returns a name for one intermediate value, or for a function."""
        self.temporaries += 1
        return f"{letter}{self.temporaries}"

    def held(self, value: ast.expr, *, lasts: bool = False) -> tuple[ast.expr, str]:
        """Code that gives the value, and the variable that then holds it: at least until other code runs."""
        if isinstance(value, ast.Name) and not lasts:
            return value, value.id
        kept = self.temporary()
        return build_expression("(KEPT := VALUE)", KEPT=kept, VALUE=value), kept

    def at(self, node: Node, tree: ast.expr | ast.stmt) -> None:
        """Errors of this code have this place."""
        if not hasattr(tree, "lineno"):
            self.places.append(node.start_point)
            tree.lineno = len(self.places) + 1

    def located(self, node: Node, template: str, kind: ValueKind = ValueKind.ANY, /, **filled: Part) -> Term:
        """Returns the term of a template, with the place of its errors."""
        term = Term(build_expression(template, **filled), kind)
        self.at(node, term.code)
        return term

    def compiled(self, role: str, scope: Scope, node: Node) -> Any:
        """What the method for a node's type makes of it. Raises SyntaxRefused for what the language does not have."""
        compiler = getattr(self, f"{role}_{node.type}", None)
        if compiler is None:
            raise SyntaxRefused(node, f"{node.type.replace('_', ' ')} is not part of the language of labs")
        return compiler(scope, node)

    # Conversions and operators

    def number(self, term: Term) -> ast.expr:
        """Returns the code of the value as a float."""
        if term.kind is ValueKind.NUMBER:
            return term.code
        if isinstance(term.code, ast.IfExp) and term.kind is ValueKind.ELEMENT:
            return ast.IfExp(term.code.test, term.code.body, build_name("nan"))
        first, value = self.held(term.code)
        return build_expression("V if kind_of(FIRST) is float_type else number(machine, V)", FIRST=first, V=value)

    def truth(self, term: Term) -> ast.expr:
        """Code that Python finds true where JavaScript finds the value true."""
        return term.code if term.kind is ValueKind.BOOLEAN else build_expression("truth(V)", V=term.code)

    def combined(self, node: Node, operator: str, left: Term, right: Term) -> Term:
        """`left operator right`, both evaluated, in this order."""
        compares, python = operator in COMPARISONS, PYTHON.get(operator)
        kind = ValueKind.BOOLEAN if compares else ValueKind.NUMBER
        if (compares or operator == "+") and not left.kind is right.kind is ValueKind.NUMBER:
            (first, a), (second, b) = self.held(left.code, lasts=True), self.held(right.code)
            text = f"A {python} B if kind_of(FIRST) is kind_of(SECOND) is float_type else slow(machine, OPERATOR, A, B)"
            called, known = OPERATORS[operator], kind if compares else ValueKind.ANY
            return self.located(node, text, known, FIRST=first, SECOND=second, OPERATOR=called, A=a, B=b)
        text = f"A {python} B" if python else f"{OPERATORS[operator]}(A, B)"
        return self.located(node, text, kind, A=self.number(left), B=self.number(right))

    def chosen(self, operator: str, left: Term, right: Term) -> Term:
        """`left operator right` for `&&`, `||` and `??`."""
        first, value = self.held(left.code)
        truth = self.truth(Term(first, left.kind))
        tree = build_expression(LOGICAL[operator], FIRST=first, TRUE=truth, LEFT=value, RIGHT=right.code)
        return Term(tree, join_kinds(left.stored_kind, right.stored_kind))

    def _term_binary_expression(self, scope: Scope, node: Node) -> Term:
        operator = read_operator(node, BINARY)
        left, right = self.term(scope, get_field(node, "left")), self.term(scope, get_field(node, "right"))
        return self.chosen(operator, left, right) if operator in LOGICAL else self.combined(node, operator, left, right)

    def _term_unary_expression(self, scope: Scope, node: Node) -> Term:
        template, kind = UNARY[read_operator(node, UNARY)]
        term = self.term(scope, get_field(node, "argument"))
        return Term(build_expression(template, NUMBER=self.number(term), TRUTH=self.truth(term), VALUE=term.code), kind)

    def _term_ternary_expression(self, scope: Scope, node: Node) -> Term:
        test, yes, no = (
            self.term(scope, get_field(node, part)) for part in ("condition", "consequence", "alternative")
        )
        return Term(ast.IfExp(self.truth(test), yes.code, no.code), join_kinds(yes.stored_kind, no.stored_kind))

    def _term_sequence_expression(self, scope: Scope, node: Node) -> Term:
        terms = [self.term(scope, part) for part in list_parts(node)]
        return Term(build_sequence(*[term.code for term in terms]), terms[-1].stored_kind)

    # Variables, literals and names

    def variable(self, binding: Binding) -> Term:
        """Returns a variable that is read."""
        return Term(
            build_name(binding.name),
            ValueKind.ANY if self.kinds is None else self.kinds.get(binding.name, ValueKind.NUMBER),
        )

    def stored(self, scope: Scope, binding: Binding, term: Term) -> None:
        """Note what is known of a value that a variable gets."""
        self.variable_kinds[binding.name] = join_kinds(
            self.variable_kinds.get(binding.name, term.stored_kind), term.stored_kind
        )
        if scope.frame is not binding.frame:
            scope.frame.outer.add(binding.name)

    def term(self, scope: Scope, node: Node) -> Term:
        """Returns the code of an expression. Raises SyntaxRefused for what the language does not have."""
        literal = LITERALS.get(node.type)
        term: Term = self.compiled("_term", scope, node) if literal is None else build_constant(literal(node))
        return term

    def value_of(self, scope: Scope, node: Node) -> ast.expr:
        """Returns the value of a node."""
        return self.term(scope, node).code

    def _term_identifier(self, scope: Scope, node: Node) -> Term:
        text = read_text(node)
        if text in NAMED:
            return Term(build_name(NAMED[text]))
        if text in paths.CONSTANTS:
            return build_constant(paths.CONSTANTS[text])
        if text in ROOTS or text in CONSTRUCTORS or find_function_path(node) or scope.find(node).kind == "function":
            raise SyntaxRefused(node, f"{text} cannot be used as a value")
        return self.variable(scope.find(node))

    _term_undefined = _term_identifier

    def _term_parenthesized_expression(self, scope: Scope, node: Node) -> Term:
        return self.term(scope, list_parts(node)[0])

    def _term_template_string(self, scope: Scope, node: Node) -> Term:
        pieces: list[ast.expr] = []
        for child in list_parts(node):
            if child.type == "template_substitution":
                pieces.append(self.value_of(scope, list_parts(child)[0]))
            else:
                escaped = child.type == "escape_sequence"
                text = read_escape(child) if escaped else re.sub("\r\n?", "\n", read_text(child))
                pieces.append(ast.Constant(to_units(text)))
        return self.located(node, "host(machine, F, [PIECES])", F=self.need("function", "`"), PIECES=pieces)

    def items(self, scope: Scope, nodes: list[Node]) -> list[ast.expr]:
        """Returns the values of a list, with `...array` spread out."""
        return [
            ast.Starred(build_expression("spread(machine, V)", V=self.value_of(scope, list_parts(node)[0])), ast.Load())
            if node.type == "spread_element"
            else self.value_of(scope, node)
            for node in nodes
        ]

    def _term_array(self, scope: Scope, node: Node) -> Term:
        return self.located(node, "array([ITEMS])", ITEMS=self.items(scope, list_parts(node)))

    def _term_object(self, scope: Scope, node: Node) -> Term:
        """`{rows: 'pos'}`: the options of a call, and nothing else."""
        if node.parent is None or node.parent.type != "arguments":
            raise SyntaxRefused(
                node,
                "{...} is available as an argument only, such as lib.jacobianSV('tip', {rows: 'pos'}); "
                "or for a number that the question draws: name it in `draw`",
            )
        names: list[ast.expr] = []
        values: list[ast.expr] = []
        for pair in list_parts(node):
            if pair.type != "pair" or get_field(pair, "key").type != "property_identifier":
                raise SyntaxRefused(pair, "write name: value")
            names.append(ast.Constant(read_text(get_field(pair, "key"))))
            values.append(self.value_of(scope, get_field(pair, "value")))
        return self.located(node, "record([NAMES], [VALUES])", NAMES=names, VALUES=values)
