"""Expressions: each node of the tree becomes a Python expression, which checks only types that are not known.

A method `_term_x` compiles the grammar's node type `x`; `_link_x` a link of a chain such as `a.b[0].c()`.
"""

import ast
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

from tree_sitter import Node

from grader.expressions import fields, paths
from grader.expressions.code import Kind, Part, Term, code, in_turn, join, name
from grader.expressions.lib import RECORD_PARTS
from grader.expressions.methods import CALLBACK_METHODS
from grader.expressions.methods import NAMES as METHODS
from grader.expressions.runtime import FUNCTIONS, OPERATORS
from grader.expressions.scope import CONSTANTS, ROOTS, Binding, Scope
from grader.expressions.syntax import Refused, escape_of, field, number_of, parts, string_of, text_of
from grader.expressions.values import in_units

COMPARISONS = {"<": "<", "<=": "<=", ">": ">", ">=": ">=", "===": "==", "!==": "!=", "==": "==", "!=": "!="}
PYTHON = {**COMPARISONS, "+": "+", "-": "-", "*": "*"}
"""The operators that mean for floats what this one means in Python."""

LOGICAL = {
    "&&": "RIGHT if TRUE else LEFT",
    "||": "LEFT if TRUE else RIGHT",
    "??": "RIGHT if FIRST is None or LEFT is undefined else LEFT",
}
"""The operators whose right side may not be evaluated."""

UNARY = {"-": "-A", "+": "A", "~": "complement(A)"}
"""The operators of one number."""

CONSTRUCTORS = ("Array", "Float64Array")
NO_FUNCTIONS = ROOTS | {"value", "undefined"}

Build = Callable[[ast.expr], ast.expr]
"""Makes the code of a link such as `.length` or `[0]` of the code of the value before it."""


class Place(NamedTuple):
    """What an assignment writes to. `begin` is evaluated first; `read` and `write` make code that follows it."""

    read: Callable[[], Term]
    write: Build
    begin: tuple[ast.expr, ...] = ()
    binding: Binding | None = None


def is_optional(node: Node) -> bool:
    """Whether this link of a chain is written with `?.`."""
    return node.child_by_field_name("optional_chain") is not None


def host_path(node: Node) -> str | None:
    """The path of the host's function of this name, if it is one."""
    path = text_of(node) if node.type == "identifier" else None
    if node.type == "member_expression" and field(node, "object").type == "identifier":
        path = f"{text_of(field(node, 'object'))}.{text_of(field(node, 'property'))}"
    return path if path in FUNCTIONS else None


def operator_of(node: Node, known: set[str]) -> str:
    """The operator of a node. Raises Refused for one that is not known."""
    operator = text_of(field(node, "operator"))
    if operator.removesuffix("=" if node.type.startswith("augmented") else "") not in known:
        raise Refused(node, f"the operator {operator} is not part of the language of labs")
    return operator


class Terms(ABC):
    """Compiles the expressions of one text.

    `kinds` is what is assumed of each variable (None: nothing), `found` what is assigned to it; `needs` names what a
    machine binds before the program runs; `places` are the positions of errors, by line of the compiled code.
    """

    def __init__(self, kinds: dict[str, Kind] | None) -> None:
        self.kinds = kinds
        self.found: dict[str, Kind] = {}
        self.needs: dict[tuple[str, str], str] = {}
        self.places: list[tuple[int, int]] = []
        self.temporaries = 0

    def need(self, kind: str, path: str) -> str:
        """The variable for what a machine binds for the path; the kinds are those of `paths.BINDERS`."""
        return self.needs.setdefault((kind, path), f"n{len(self.needs)}")

    def temporary(self, letter: str = "t") -> str:
        """A name for one intermediate value, or for a function."""
        self.temporaries += 1
        return f"{letter}{self.temporaries}"

    def held(self, value: ast.expr, *, lasts: bool = False) -> tuple[ast.expr, str]:
        """Code that gives the value, and the variable that then holds it: at least until other code runs."""
        if isinstance(value, ast.Name) and not lasts:
            return value, value.id
        kept = self.temporary()
        return code("(KEPT := VALUE)", KEPT=kept, VALUE=value), kept

    def at(self, node: Node, made: ast.expr | ast.stmt) -> None:
        """Errors of this code have this place."""
        if not hasattr(made, "lineno"):
            self.places.append(node.start_point)
            made.lineno = len(self.places) + 1

    def located(self, node: Node, template: str, kind: Kind = Kind.ANY, /, **filled: Part) -> Term:
        """The term of a template, with the place of its errors."""
        term = Term(code(template, **filled), kind)
        self.at(node, term.code)
        return term

    def compiled(self, role: str, scope: Scope, node: Node) -> Any:
        """What the method for a node's type makes of it. Raises Refused for what the language does not have."""
        compiler = getattr(self, f"{role}_{node.type}", None)
        if compiler is None:
            raise Refused(node, f"{node.type.replace('_', ' ')} is not part of the language of labs")
        return compiler(scope, node)

    # Conversions and operators

    def number(self, term: Term) -> ast.expr:
        """The code of the value as a float."""
        if term.kind is Kind.NUMBER:
            return term.code
        if isinstance(term.code, ast.IfExp) and term.kind is Kind.ELEMENT:
            return ast.IfExp(term.code.test, term.code.body, name("nan"))
        first, value = self.held(term.code)
        return code("V if kind_of(FIRST) is float_type else number(machine, V)", FIRST=first, V=value)

    def truth(self, term: Term) -> ast.expr:
        """Code that Python finds true where JavaScript finds the value true."""
        return term.code if term.kind is Kind.BOOLEAN else code("truth(V)", V=term.code)

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
        made = code(LOGICAL[operator], FIRST=first, TRUE=truth, LEFT=value, RIGHT=right.code)
        return Term(made, join(left.kept, right.kept))

    def _term_binary_expression(self, scope: Scope, node: Node) -> Term:
        operator = operator_of(node, {*OPERATORS, *PYTHON, *LOGICAL})
        left, right = self.term(scope, field(node, "left")), self.term(scope, field(node, "right"))
        return self.chosen(operator, left, right) if operator in LOGICAL else self.combined(node, operator, left, right)

    def _term_unary_expression(self, scope: Scope, node: Node) -> Term:
        operator = operator_of(node, {*UNARY, "!", "typeof"})
        term = self.term(scope, field(node, "argument"))
        if operator == "-" and term.literal is not None:
            return Term(ast.Constant(-term.literal), Kind.NUMBER)
        if operator == "!":
            return Term(code("not A", A=self.truth(term)), Kind.BOOLEAN)
        if operator == "typeof":
            return Term(code("type_name(A)", A=term.code))
        return Term(code(UNARY[operator], A=self.number(term)), Kind.NUMBER)

    def _term_ternary_expression(self, scope: Scope, node: Node) -> Term:
        test, yes, no = (self.term(scope, field(node, part)) for part in ("condition", "consequence", "alternative"))
        return Term(ast.IfExp(self.truth(test), yes.code, no.code), join(yes.kept, no.kept))

    def _term_sequence_expression(self, scope: Scope, node: Node) -> Term:
        terms = [self.term(scope, part) for part in parts(node)]
        return Term(in_turn(*[term.code for term in terms]), terms[-1].kept)

    # Variables, literals and names

    def variable(self, binding: Binding) -> Term:
        """A variable that is read."""
        return Term(name(binding.name), Kind.ANY if self.kinds is None else self.kinds.get(binding.name, Kind.NUMBER))

    def stored(self, scope: Scope, binding: Binding, term: Term) -> None:
        """Note what is known of a value that a variable gets."""
        self.found[binding.name] = join(self.found.get(binding.name, term.kept), term.kept)
        if scope.frame is not binding.frame:
            scope.frame.outer.add(binding.name)

    def term(self, scope: Scope, node: Node) -> Term:
        """The code of an expression. Raises Refused for what the language does not have."""
        made: Term = self.compiled("_term", scope, node)
        return made

    def value_of(self, scope: Scope, node: Node) -> ast.expr:
        """The value of a node."""
        return self.term(scope, node).code

    def _term_identifier(self, scope: Scope, node: Node) -> Term:
        text = text_of(node)
        if text == "undefined":
            return Term(name("undefined"))
        if text in CONSTANTS:
            return Term(ast.Constant(float(text)), Kind.NUMBER)
        if text == "value":
            return Term(name("given"))
        if text in ROOTS or text in CONSTRUCTORS or host_path(node) or scope.find(node).kind == "function":
            raise Refused(node, f"{text} cannot be used as a value")
        return self.variable(scope.find(node))

    _term_undefined = _term_identifier

    def _term_parenthesized_expression(self, scope: Scope, node: Node) -> Term:
        return self.term(scope, parts(node)[0])

    def _term_number(self, scope: Scope, node: Node) -> Term:
        return Term(ast.Constant(number_of(node)), Kind.NUMBER)

    def _term_true(self, scope: Scope, node: Node) -> Term:
        return Term(ast.Constant(node.type == "true"), Kind.BOOLEAN)

    _term_false = _term_true

    def _term_null(self, scope: Scope, node: Node) -> Term:
        return Term(ast.Constant(None))

    def _term_string(self, scope: Scope, node: Node) -> Term:
        return Term(ast.Constant(string_of(node)))

    def _term_template_string(self, scope: Scope, node: Node) -> Term:
        pieces: list[ast.expr] = []
        for child in parts(node):
            if child.type == "template_substitution":
                pieces.append(self.value_of(scope, parts(child)[0]))
            elif child.type == "escape_sequence":
                pieces.append(ast.Constant(in_units(escape_of(child))))
            else:
                pieces.append(ast.Constant(in_units(text_of(child).replace("\r\n", "\n").replace("\r", "\n"))))
        return self.located(node, "template(machine, [PIECES])", PIECES=pieces)

    def items(self, scope: Scope, nodes: list[Node]) -> list[ast.expr]:
        """The values of a list, with `...array` spread out."""
        return [
            ast.Starred(code("spread(machine, V)", V=self.value_of(scope, parts(node)[0])), ast.Load())
            if node.type == "spread_element"
            else self.value_of(scope, node)
            for node in nodes
        ]

    def _term_array(self, scope: Scope, node: Node) -> Term:
        return self.located(node, "array([ITEMS])", ITEMS=self.items(scope, parts(node)))

    # Members and elements

    def at_path(self, node: Node, path: str) -> Term:
        """The value at a path. Raises Refused where it names nothing that may be read."""
        if path in paths.CONSTANTS:
            return Term(ast.Constant(paths.CONSTANTS[path]), Kind.NUMBER)
        if path in paths.WRITABLE:
            return Term(name(self.need("vector", path)))
        if key := paths.ctx_name(node, path):
            self.need("ctx", key)
            return Term(code("ctx[KEY]", KEY=ast.Constant(key)))
        if path not in paths.NUMBERS:
            raise Refused(node, f"{path} cannot be read here")
        kind = paths.NUMBERS[path]
        return Term(code("READ()" if kind == "scalar" else "READ", READ=self.need(kind, path)), Kind.NUMBER)

    def _link_member_expression(self, scope: Scope, node: Node) -> Term | Build:
        path = paths.path_of(node)
        key, owner = text_of(field(node, "property")), paths.path_of(field(node, "object"))
        if path is not None and (key != "length" or owner in ROOTS):
            return self.at_path(node, path)
        if key not in RECORD_PARTS and key != "length":
            raise Refused(field(node, "property"), f".{key} is not available")
        if path is not None and owner in paths.WRITABLE:
            return Term(name(self.need("size", owner or "")), Kind.NUMBER)
        return lambda value: code("member(V, KEY)", V=value, KEY=ast.Constant(key))

    def _link_subscript_expression(self, scope: Scope, node: Node) -> Term | Build:
        path = self._field_of(node)
        if path is not None and not is_optional(node):
            return self._element(node, path, self.need("vector", path), self.term(scope, field(node, "index")))
        return lambda value: code("read_index(V, INDEX)", V=value, INDEX=self.value_of(scope, field(node, "index")))

    def _field_of(self, node: Node) -> str | None:
        """The path of the field whose element a subscript names, if it is one. Square brackets take numbers."""
        path = paths.path_of(field(node, "object"))
        if path in ROOTS:
            raise Refused(node, "square brackets take the number of an element; name a field with a dot")
        if field(node, "index").type in ("string", "template_string"):
            raise Refused(field(node, "index"), "square brackets take the number of an element")
        return path if path in paths.WRITABLE else None

    def _element(self, node: Node, path: str | None, array: Part, index: Term) -> Term:
        """An element of an array; `path` is the array's where it is a field."""
        if path is None or index.kind is not Kind.NUMBER or not paths.holds_floats(path):
            return self.located(node, "read_index(V, INDEX)", V=array, INDEX=index.code)
        view = self.need("view", path)
        if index.literal is not None and index.literal >= 0 and index.literal.is_integer():
            known, size = ast.Constant(int(index.literal)), self.need("size", path)
            made = code("VIEW[KEY] if INDEX < SIZE else undefined", VIEW=view, KEY=known, INDEX=index.code, SIZE=size)
        else:
            (first, key), at = self.held(index.code), self.need("positions", path)
            made = code("VIEW[AT[KEY]] if FIRST in AT else undefined", VIEW=view, AT=at, KEY=key, FIRST=first)
        return Term(made, Kind.ELEMENT)

    def _term_member_expression(self, scope: Scope, node: Node) -> Term:
        term, cuts = self._chain(scope, node)
        for first, value in reversed(cuts):
            text = "undefined if FIRST is None or V is undefined else REST"
            term = Term(code(text, FIRST=first, V=value, REST=term.code))
        return term

    _term_subscript_expression = _term_call_expression = _term_member_expression

    def _chain(self, scope: Scope, node: Node) -> tuple[Term, list[tuple[ast.expr, str]]]:
        """A chain up to `node`, and what cuts it at each `?.`: code that gives a value, and the variable with it."""
        compiler: Callable[[Scope, Node], Term | Build] = getattr(self, f"_link_{node.type}", self.term)
        made = compiler(scope, node)
        if isinstance(made, Term):
            return made, []
        link = field(node, "function") if node.type == "call_expression" else node
        before, cuts = self._chain(scope, field(link, "object"))
        value = before.code
        if is_optional(link):
            first, again = self.held(value)
            cuts.append((first, again))
            value = name(again)
        term = Term(made(value))
        self.at(node, term.code)
        return term, cuts

    # Calls

    def _link_call_expression(self, scope: Scope, node: Node) -> Term | Build:
        function, arguments = field(node, "function"), field(node, "arguments")
        if arguments.type != "arguments":
            raise Refused(node, "tagged templates are not part of the language of labs")
        args, path = parts(arguments), host_path(function)
        if path is not None and not is_optional(node):
            return self._host_call(scope, node, path, args)
        if function.type == "identifier":
            return self._named_call(scope, node, function, args)
        if function.type != "member_expression":
            raise Refused(node, "only functions that have a name can be called")
        return self._method_call(scope, node, function, args)

    def _host_call(self, scope: Scope, node: Node, path: str, args: list[Node]) -> Term:
        function = FUNCTIONS[path]
        if tuple(text_of(arg) for arg in args[: len(function.takes)]) != function.takes:
            raise Refused(node, f"{text_of(field(node, 'function'))} begins with {', '.join(function.takes)}")
        if path == "Array.from" and len(args) == 2:
            text, items, callback = "map_from(machine, F, [ITEMS], G)", args[:1], args[1]
            filled: dict[str, Part] = {"ITEMS": self.items(scope, items), "G": self.function(scope, callback)}
            return self.located(node, text, F=self.need("function", path), **filled)
        rest = args[len(function.takes) :]
        plain = not any(arg.type == "spread_element" for arg in rest)
        if function.numeric is not None and plain and len(rest) <= (function.arity or len(rest)):
            numbers = [self.number(self.term(scope, arg)) for arg in rest]
            numbers += [name("nan")] * ((function.arity or 0) - len(numbers))
            text, called = "F(NUMBERS) if tick(machine) else 0.0", self.need("numeric", path)
            return self.located(node, text, Kind.NUMBER, F=called, NUMBERS=numbers)
        kind = {float: Kind.NUMBER, bool: Kind.BOOLEAN, None: Kind.ANY}[function.gives]
        called, given = self.need("function", path), self.items(scope, rest)
        return self.located(node, "host(machine, F, [ITEMS])", kind, F=called, ITEMS=given)

    def _named_call(self, scope: Scope, node: Node, function: Node, args: list[Node]) -> Term:
        text = text_of(function)
        if text in CONSTRUCTORS:
            raise Refused(node, f"write new {text}(...)")
        if text in NO_FUNCTIONS or scope.find(function).kind != "function":
            raise Refused(function, f"{text} is no function")
        return self.located(node, "F(ITEMS)", F=scope.find(function).name, ITEMS=self.items(scope, args))

    def _method_call(self, scope: Scope, node: Node, function: Node, args: list[Node]) -> Build:
        method, path = text_of(field(function, "property")), paths.path_of(field(function, "object"))
        if method not in METHODS or path in ROOTS:
            raise Refused(function, f"{text_of(function)[:60]}() is not available")
        if method in ("set", "fill", "sort", "reverse") and paths.WRITABLE.get(path) is False:
            raise Refused(node, f"{path} can only be read")

        def build(value: ast.expr) -> ast.expr:
            callback = [name(self.function(scope, arg)) for arg in args[:1]] if method in CALLBACK_METHODS else []
            if method in CALLBACK_METHODS - {"sort"} and not callback:
                raise Refused(node, f"{method} needs a function")
            given = [*callback, *self.items(scope, args[len(callback) :])]
            return code("method(machine, V, METHOD, [GIVEN])", V=value, METHOD=ast.Constant(method), GIVEN=given)

        return build

    def function(self, scope: Scope, node: Node) -> str:
        """The function that an argument is: an arrow function, or the name of one. Raises Refused for others."""
        if node.type == "arrow_function":
            return self.arrow(scope, node)
        path = host_path(node)
        if path is not None and not FUNCTIONS[path].takes:
            return self.need("callback", path)
        if node.type == "identifier" and text_of(node) not in NO_FUNCTIONS and scope.find(node).kind == "function":
            return scope.find(node).name
        raise Refused(node, "a function is needed here, such as x => 2 * x")

    @abstractmethod
    def arrow(self, scope: Scope, node: Node) -> str:
        """The name of the Python function that an arrow function becomes; compiled with the statements."""

    def _term_new_expression(self, scope: Scope, node: Node) -> Term:
        """`new Array(n).fill(x)` and `new Float64Array(n)`; nothing else is constructed."""
        constructor, arguments = text_of(field(node, "constructor")), node.child_by_field_name("arguments")
        args = parts(arguments) if arguments is not None else []
        if constructor == "Float64Array":
            return self.located(node, "typed_array(machine, [ITEMS])", ITEMS=self.items(scope, args))
        parent = node.parent
        filled = parent is not None and parent.type == "member_expression"
        filled = filled and parent is not None and text_of(field(parent, "property")) == "fill"
        if constructor == "Array" and len(args) == 1 and args[0].type != "spread_element" and filled:
            return self.located(node, "empty_array(machine, SIZE)", SIZE=self.value_of(scope, args[0]))
        raise Refused(node, "only new Array(n).fill(x) and new Float64Array(n) are available")

    # Assignments

    def place(self, scope: Scope, node: Node, again: bool) -> Place:
        """What an assignment writes to, which is read `again` or not. Raises Refused where it cannot be written."""
        if node.type == "parenthesized_expression":
            return self.place(scope, parts(node)[0], again)
        if node.type == "subscript_expression" and not is_optional(node):
            return self._element_place(scope, node, again)
        path = paths.path_of(node)
        if node.type == "member_expression" and path is not None:
            return self._path_place(node, path)
        if node.type != "identifier" or text_of(node) in NO_FUNCTIONS:
            raise Refused(node, "this cannot be assigned")
        binding = scope.find(node)
        if binding.kind not in ("let", "var", "parameter"):
            raise Refused(node, f"{text_of(node)} is constant")
        return Place(
            lambda: self.variable(binding),
            lambda new: code("(V := NEW)", V=binding.name, NEW=new),
            binding=binding,
        )

    def _path_place(self, node: Node, path: str) -> Place:
        def read() -> Term:
            return self.at_path(node, path)

        if key := paths.ctx_name(node, path):
            read()
            return Place(read, lambda new: code("put(ctx, KEY, NEW)", KEY=ast.Constant(key), NEW=new))
        if paths.NUMBERS.get(path) == "scalar" and path.removeprefix("data.") not in fields.DATA_COUNTS:
            return Place(read, lambda new: code("WRITE(NEW)", WRITE=self.need("write scalar", path), NEW=new))
        if path in paths.WRITABLE:
            raise Refused(node, f"{path} is an array: assign its elements, or use .set() or .fill()")
        raise Refused(node, f"{path} cannot be assigned")

    def _element_place(self, scope: Scope, node: Node, again: bool) -> Place:
        path = self._field_of(node)
        if path is not None and not paths.WRITABLE[path]:
            raise Refused(node, f"{path} can only be read")
        array, index = self.term(scope, field(node, "object")), self.term(scope, field(node, "index"))
        begin: list[ast.expr] = []
        for term in (array, index) if again else ():
            if not isinstance(term.code, ast.Constant) and (path is None or term is index):
                first, kept = self.held(term.code, lasts=True)
                begin.append(first)
                term.kind, term.code = term.kept, name(kept)

        def write(new: ast.expr) -> ast.expr:
            if path is None:
                return code("write_index(V, INDEX, NEW)", V=array.code, INDEX=index.code, NEW=new)
            return code("WRITE(INDEX, NEW)", WRITE=self.need("write", path), INDEX=index.code, NEW=new)

        return Place(lambda: self._element(node, path, array.code, index), write, tuple(begin))

    def written(self, scope: Scope, node: Node, place: Place, new: Term) -> Term:
        """The assignment of a value, which is the value of the assignment."""
        if place.binding is not None:
            self.stored(scope, place.binding, new)
        made = Term(place.write(new.code), new.kept)
        self.at(node, made.code)
        return made

    def _term_assignment_expression(self, scope: Scope, node: Node) -> Term:
        place = self.place(scope, field(node, "left"), again=False)
        return self.written(scope, node, place, self.term(scope, field(node, "right")))

    def _term_augmented_assignment_expression(self, scope: Scope, node: Node) -> Term:
        place = self.place(scope, field(node, "left"), again=True)
        operator = operator_of(node, {*OPERATORS, *PYTHON, *LOGICAL})[:-1]
        right = self.term(scope, field(node, "right"))
        if operator in LOGICAL:
            made = self.chosen(operator, place.read(), self.written(scope, node, place, right))
        else:
            made = self.written(scope, node, place, self.combined(node, operator, place.read(), right))
        return Term(in_turn(*place.begin, made.code), made.kind)

    def update(self, scope: Scope, node: Node, old_value: bool) -> Term:
        """`place++` or `--place`: the old or the new value."""
        place = self.place(scope, field(node, "argument"), again=True)
        old, kept = self.number(place.read()), ""
        if old_value:
            old, kept = self.held(old, lasts=True)
        one = Term(ast.Constant(1.0), Kind.NUMBER)
        new = self.combined(node, text_of(field(node, "operator"))[0], Term(old, Kind.NUMBER), one)
        written = self.written(scope, node, place, new).code
        return Term(in_turn(*place.begin, written, *([name(kept)] if kept else [])), Kind.NUMBER)

    def _term_update_expression(self, scope: Scope, node: Node) -> Term:
        return self.update(scope, node, old_value=node.children[0].type not in ("++", "--"))
