"""Expressions: each node of the tree becomes a Python expression, which checks only types that are not known. A method
`_term_x` compiles the grammar's node type `x`; `_link_x` a link of a chain such as `a.b[0].c()`."""

import ast
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from functools import partial
from typing import Any, NamedTuple

from tree_sitter import Node

from grader.expressions import fields, paths
from grader.expressions.code import (
    Kind,
    Part,
    Term,
    build_constant,
    build_expression,
    build_name,
    build_sequence,
    join_kinds,
)
from grader.expressions.lib import RECORD_PARTS
from grader.expressions.machine import count_arguments, find_callback
from grader.expressions.methods import CALLBACKS
from grader.expressions.runtime import FUNCTIONS, OPERATORS
from grader.expressions.scope import ROOTS, Binding, Scope
from grader.expressions.syntax import FUNCTIONS as FUNCTION_TYPES
from grader.expressions.syntax import (
    SyntaxRefused,
    get_field,
    list_parts,
    read_escape,
    read_number,
    read_string,
    read_text,
)
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
    "-": ("-NUMBER", Kind.NUMBER),
    "+": ("NUMBER", Kind.NUMBER),
    "~": ("complement(NUMBER)", Kind.NUMBER),
    "!": ("not TRUTH", Kind.BOOLEAN),
    "typeof": ("type_name(VALUE)", Kind.ANY),
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
ARRAY_WRITERS = ("set", "fill", "sort", "reverse")
"""The methods that write into a typed array."""

NO_FUNCTIONS = ROOTS | NAMED.keys() | paths.CONSTANTS.keys()

Build = Callable[[ast.expr], ast.expr]
"""Makes the code of a link such as `.length` or `[0]` of the code of the value before it."""


class Place(NamedTuple):
    """What an assignment writes to. `begin` is evaluated first; `read` and `write` make code that follows it."""

    read: Callable[[], Term]
    write: Callable[[Term], ast.expr]
    begin: tuple[ast.expr, ...] = ()


def is_optional(node: Node) -> bool:
    """Whether this link of a chain is written with `?.`."""
    return node.child_by_field_name("optional_chain") is not None


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


class Terms(ABC):
    """Compiles the expressions of one text. `kinds` is what is assumed of each variable (None: nothing), `found` what
    is assigned to it; `needs` names what a machine binds before the program runs; `places` are the positions of errors,
    by line of the compiled code."""

    def __init__(self, kinds: dict[str, Kind] | None) -> None:
        self.kinds = kinds
        self.variable_kinds: dict[str, Kind] = {}
        self.needs: dict[tuple[str, str], str] = {}
        self.places: list[tuple[int, int]] = []
        self.temporaries = 0

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

    def at(self, node: Node, made: ast.expr | ast.stmt) -> None:
        """Errors of this code have this place."""
        if not hasattr(made, "lineno"):
            self.places.append(node.start_point)
            made.lineno = len(self.places) + 1

    def located(self, node: Node, template: str, kind: Kind = Kind.ANY, /, **filled: Part) -> Term:
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
        if term.kind is Kind.NUMBER:
            return term.code
        if isinstance(term.code, ast.IfExp) and term.kind is Kind.ELEMENT:
            return ast.IfExp(term.code.test, term.code.body, build_name("nan"))
        first, value = self.held(term.code)
        return build_expression("V if kind_of(FIRST) is float_type else number(machine, V)", FIRST=first, V=value)

    def truth(self, term: Term) -> ast.expr:
        """Code that Python finds true where JavaScript finds the value true."""
        return term.code if term.kind is Kind.BOOLEAN else build_expression("truth(V)", V=term.code)

    def combined(self, node: Node, operator: str, left: Term, right: Term) -> Term:
        """`left operator right`, both evaluated, in this order."""
        compares, python = operator in COMPARISONS, PYTHON.get(operator)
        kind = Kind.BOOLEAN if compares else Kind.NUMBER
        if (compares or operator == "+") and not left.kind is right.kind is Kind.NUMBER:
            (first, a), (second, b) = self.held(left.code, lasts=True), self.held(right.code)
            text = f"A {python} B if kind_of(FIRST) is kind_of(SECOND) is float_type else slow(machine, OPERATOR, A, B)"
            called, known = OPERATORS[operator], kind if compares else Kind.ANY
            return self.located(node, text, known, FIRST=first, SECOND=second, OPERATOR=called, A=a, B=b)
        text = f"A {python} B" if python else f"{OPERATORS[operator]}(A, B)"
        return self.located(node, text, kind, A=self.number(left), B=self.number(right))

    def chosen(self, operator: str, left: Term, right: Term) -> Term:
        """`left operator right` for `&&`, `||` and `??`."""
        first, value = self.held(left.code)
        truth = self.truth(Term(first, left.kind))
        made = build_expression(LOGICAL[operator], FIRST=first, TRUE=truth, LEFT=value, RIGHT=right.code)
        return Term(made, join_kinds(left.stored_kind, right.stored_kind))

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
            build_name(binding.name), Kind.ANY if self.kinds is None else self.kinds.get(binding.name, Kind.NUMBER)
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
        made: Term = self.compiled("_term", scope, node) if literal is None else build_constant(literal(node))
        return made

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
                node, "{...} is available as an argument only, such as lib.jacobianSV('tip', {rows: 'pos'})"
            )
        names: list[ast.expr] = []
        values: list[ast.expr] = []
        for pair in list_parts(node):
            if pair.type != "pair" or get_field(pair, "key").type != "property_identifier":
                raise SyntaxRefused(pair, "write name: value")
            names.append(ast.Constant(read_text(get_field(pair, "key"))))
            values.append(self.value_of(scope, get_field(pair, "value")))
        return self.located(node, "record([NAMES], [VALUES])", NAMES=names, VALUES=values)

    # Members and elements

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
            raise SyntaxRefused(node, f"{path} cannot be read here")
        kind = paths.NUMBERS[path]
        return Term(build_expression("READ()" if kind == "scalar" else "READ", READ=self.need(kind, path)), Kind.NUMBER)

    def _link_member_expression(self, scope: Scope, node: Node) -> Term | Build:
        path = paths.find_path(node)
        key, owner = read_text(get_field(node, "property")), paths.find_path(get_field(node, "object"))
        if path is not None and (key != "length" or owner in ROOTS):
            return self.at_path(node, path)
        if key not in RECORD_PARTS and key != "length":
            raise SyntaxRefused(get_field(node, "property"), f".{key} is not available")
        if path is not None and owner in paths.WRITABLE:
            return Term(build_name(self.need("size", owner or "")), Kind.NUMBER)
        return lambda value: build_expression("member(V, KEY)", V=value, KEY=ast.Constant(key))

    def _link_subscript_expression(self, scope: Scope, node: Node) -> Term | Build:
        path = self._field_of(node)
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
        if path is None or index.kind is not Kind.NUMBER or not paths.holds_floats(path):
            return self.located(node, "read_index(V, INDEX)", V=array, INDEX=index.code)
        view = self.need("view", path)
        known = index.code.value if isinstance(index.code, ast.Constant) else None
        if isinstance(known, float) and known >= 0 and known.is_integer():
            place, size = ast.Constant(int(known)), self.need("size", path)
            made = build_expression(
                "VIEW[KEY] if INDEX < SIZE else undefined", VIEW=view, KEY=place, INDEX=index.code, SIZE=size
            )
        else:
            (first, key), at = self.held(index.code), self.need("positions", path)
            made = build_expression(
                "VIEW[AT[KEY]] if FIRST in AT else undefined", VIEW=view, AT=at, KEY=key, FIRST=first
            )
        return Term(made, Kind.ELEMENT)

    def _term_member_expression(
        self, scope: Scope, node: Node, rest: Callable[[Term], Term] = lambda term: term
    ) -> Term:
        """Returns the `rest` of a chain after `node`: all of it is undefined where a `?.` finds null or undefined."""
        compiler: Callable[[Scope, Node], Term | Build] = getattr(self, f"_link_{node.type}", self.term)
        made = compiler(scope, node)
        if isinstance(made, Term):
            return rest(made)
        link = get_field(node, "function") if node.type == "call_expression" else node

        def follow(before: Term) -> Term:
            optional = is_optional(link)
            first, again = self.held(before.code) if optional else (before.code, "")
            term = Term(made(build_name(again) if optional else first))
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
            return self.located(node, text, Kind.NUMBER, F=called, NUMBERS=numbers)
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
            raise SyntaxRefused(function, f"{read_text(function)[:60]}() is not available")
        if method in ARRAY_WRITERS and paths.WRITABLE.get(path) is False:
            raise SyntaxRefused(node, f"{path} can only be read")

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

    # Assignments

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
        made = Term(place.write(new), new.stored_kind)
        self.at(node, made.code)
        return made

    def _term_assignment_expression(self, scope: Scope, node: Node) -> Term:
        place = self.place(scope, get_field(node, "left"), again=False)
        return self.written(node, place, self.term(scope, get_field(node, "right")))

    def _term_augmented_assignment_expression(self, scope: Scope, node: Node) -> Term:
        place = self.place(scope, get_field(node, "left"), again=True)
        operator, right = read_operator(node, BINARY)[:-1], self.term(scope, get_field(node, "right"))
        if operator in LOGICAL:
            made = self.chosen(operator, place.read(), self.written(node, place, right))
        else:
            made = self.written(node, place, self.combined(node, operator, place.read(), right))
        return Term(build_sequence(*place.begin, made.code), made.kind)

    def update(self, scope: Scope, node: Node, old_value: bool) -> Term:
        """`place++` or `--place`: the old or the new value."""
        place = self.place(scope, get_field(node, "argument"), again=True)
        old, kept = self.number(place.read()), ""
        if old_value:
            old, kept = self.held(old, lasts=True)
        new = self.combined(
            node, read_text(get_field(node, "operator"))[0], Term(old, Kind.NUMBER), build_constant(1.0)
        )
        written = self.written(node, place, new).code
        return Term(build_sequence(*place.begin, written, *([build_name(kept)] if kept else [])), Kind.NUMBER)

    def _term_update_expression(self, scope: Scope, node: Node) -> Term:
        return self.update(scope, node, old_value=node.children[0].type not in ("++", "--"))
