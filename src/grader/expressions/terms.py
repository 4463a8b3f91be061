"""Expressions: each node of the tree becomes a Python expression, which checks only types that are not known."""

import ast
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, NamedTuple

from tree_sitter import Node

from grader.expressions import fields, paths
from grader.expressions.code import (
    Kind,
    Term,
    call,
    compare,
    constant,
    in_turn,
    item,
    join,
    listed,
    name,
    negated,
    target,
)
from grader.expressions.functions import FUNCTIONS, Path
from grader.expressions.lib import RECORD_PARTS
from grader.expressions.methods import CALLBACK_METHODS
from grader.expressions.methods import NAMES as METHODS
from grader.expressions.runtime import OPERATORS
from grader.expressions.scope import CONSTANTS, ROOTS, Binding, Scope
from grader.expressions.syntax import Source, escape_of, field, number_of, parts, string_of, text_of
from grader.expressions.values import in_units

ARITHMETIC: dict[str, type[ast.operator]] = {"+": ast.Add, "-": ast.Sub, "*": ast.Mult}
COMPARISONS: dict[str, type[ast.cmpop]] = {
    "<": ast.Lt, "<=": ast.LtE, ">": ast.Gt, ">=": ast.GtE,
    "===": ast.Eq, "!==": ast.NotEq, "==": ast.Eq, "!=": ast.NotEq,
}  # fmt: skip
LOGICAL = ("&&", "||", "??")
CONSTRUCTORS = ("Array", "Float64Array")
NO_FUNCTIONS = ROOTS | {"value", "undefined"}

Build = Callable[[ast.expr], ast.expr]
"""Makes the code of a link such as `.length` or `[0]` of the code of the value before it."""


class Place(NamedTuple):
    """What an assignment writes to. `begin` is evaluated first; `read` and `write` make code that follows it."""

    read: Callable[[], Term]
    write: Callable[[ast.expr], ast.expr]
    begin: tuple[ast.expr, ...] = ()
    binding: Binding | None = None


def is_optional(node: Node) -> bool:
    """Whether this link of a chain is written with `?.`."""
    return node.child_by_field_name("optional_chain") is not None


def host_path(node: Node) -> Path | None:
    """The path of the host's function of this name, if it is one."""
    path: Path | None = (text_of(node),) if node.type == "identifier" else None
    if node.type == "member_expression" and field(node, "object").type == "identifier":
        path = text_of(field(node, "object")), text_of(field(node, "property"))
    return path if path in FUNCTIONS else None


class Terms(ABC):
    """Compiles the expressions of one text.

    `kinds` is what is assumed of each variable (None: nothing), `found` what is assigned to it; `needs` names what a
    machine binds before the program runs; `places` are the positions of errors, by line of the compiled code.
    """

    def __init__(self, source: Source, kinds: dict[str, Kind] | None) -> None:
        self.source, self.kinds = source, kinds
        self.found: dict[str, Kind] = {}
        self.needs: dict[tuple[str, Path], str] = {}
        self.places: list[tuple[int, int]] = []
        self.temporaries = 0

    def need(self, kind: str, path: Path) -> ast.expr:
        """What a machine binds for the path; the kinds are those of `paths.BINDERS`."""
        return name(self.needs.setdefault((kind, path), f"n{len(self.needs)}"))

    def temporary(self, letter: str = "t") -> str:
        """A name for one intermediate value, or for a function."""
        self.temporaries += 1
        return f"{letter}{self.temporaries}"

    def held(self, code: ast.expr) -> tuple[ast.expr, Callable[[], ast.expr]]:
        """The code, keeping its value in a variable; and what makes the code that gives the value again."""
        kept = self.temporary()
        return ast.NamedExpr(target(kept), code), lambda: name(kept)

    def at(self, node: Node, code: ast.expr | ast.stmt) -> None:
        """Errors of this code have this place."""
        if not hasattr(code, "lineno"):
            self.places.append(node.start_point)
            code.lineno = len(self.places) + 1

    def located(self, node: Node, code: ast.expr, kind: Kind = Kind.ANY) -> Term:
        """A term, with the place of its errors."""
        self.at(node, code)
        return Term(code, kind)

    # Conversions and operators

    def number(self, term: Term) -> ast.expr:
        """The code of the value as a float."""
        code = term.code
        if term.kind is Kind.NUMBER:
            return code
        if isinstance(code, ast.IfExp) and term.kind is Kind.ELEMENT:
            return ast.IfExp(code.test, code.body, name("nan"))
        first, again = (code, lambda: name(code.id)) if isinstance(code, ast.Name) else self.held(code)
        is_number = compare(call("kind_of", first), ast.Is, name("float_type"))
        return ast.IfExp(is_number, again(), call("number", name("machine"), again()))

    def truth(self, term: Term) -> ast.expr:
        """Code that Python finds true where JavaScript finds the value true."""
        return term.code if term.kind is Kind.BOOLEAN else call("truth", term.code)

    def combined(self, node: Node, operator: str, left: Term, right: Term) -> Term:
        """`left operator right`, both evaluated, in this order."""
        numbers = left.kind is right.kind is Kind.NUMBER
        arithmetic, comparison = ARITHMETIC.get(operator), COMPARISONS.get(operator)
        if arithmetic is not None and (numbers or operator != "+"):
            return self.located(node, ast.BinOp(self.number(left), arithmetic(), self.number(right)), Kind.NUMBER)
        if comparison is not None and numbers:
            return self.located(node, compare(left.code, comparison, right.code), Kind.BOOLEAN)
        if comparison is None and operator != "+":
            return self.located(node, call(OPERATORS[operator], self.number(left), self.number(right)), Kind.NUMBER)
        (first, a), (second, b) = self.held(left.code), self.held(right.code)
        kinds = [call("kind_of", second), name("float_type")]
        both_numbers = ast.Compare(call("kind_of", first), [ast.Is(), ast.Is()], kinds)
        fast = ast.BinOp(a(), ast.Add(), b()) if comparison is None else compare(a(), comparison, b())
        slow = call("slow", name("machine"), name(OPERATORS[operator]), a(), b())
        kind = Kind.ANY if comparison is None else Kind.BOOLEAN
        return self.located(node, ast.IfExp(both_numbers, fast, slow), kind)

    def chosen(self, operator: str, left: Term, right: Term) -> Term:
        """`left operator right` for `&&`, `||` and `??`, where the right side may not be evaluated."""
        first, again = self.held(left.code)
        if operator == "??":
            test = negated(_absent(first, again()))
        else:
            truth = self.truth(Term(first, left.kind))
            test = negated(truth) if operator == "&&" else truth
        return Term(ast.IfExp(test, again(), right.code), join(left.kept, right.kept))

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
        compiler = self.TERMS.get(node.type)
        if compiler is None:
            raise scope.refuse(node, f"{node.type.replace('_', ' ')} is not part of the language of labs")
        return compiler(self, scope, node)

    def value_of(self, scope: Scope, node: Node) -> ast.expr:
        """The value of a node."""
        return self.term(scope, node).code

    def _identifier(self, scope: Scope, node: Node) -> Term:
        text = text_of(node)
        if text == "undefined":
            return Term(name("undefined"))
        if text in CONSTANTS:
            return Term(constant(float(text)), Kind.NUMBER)
        if text == "value":
            return Term(name("given"))
        if text in ROOTS or text in CONSTRUCTORS or host_path(node) or scope.find(node).kind == "function":
            raise scope.refuse(node, f"{text} cannot be used as a value")
        return self.variable(scope.find(node))

    def _template(self, scope: Scope, node: Node) -> Term:
        pieces: list[ast.expr] = []
        for child in parts(node):
            if child.type == "template_substitution":
                pieces.append(self.value_of(scope, parts(child)[0]))
            elif child.type == "escape_sequence":
                pieces.append(constant(in_units(escape_of(self.source, child))))
            else:
                pieces.append(constant(in_units(text_of(child).replace("\r\n", "\n").replace("\r", "\n"))))
        return self.located(node, call("template", name("machine"), listed(pieces)))

    def items(self, scope: Scope, nodes: list[Node]) -> list[ast.expr]:
        """The values of a list, with `...array` spread out."""
        return [
            ast.Starred(call("spread", name("machine"), self.value_of(scope, parts(node)[0])), ast.Load())
            if node.type == "spread_element"
            else self.value_of(scope, node)
            for node in nodes
        ]

    def _array(self, scope: Scope, node: Node) -> Term:
        return self.located(node, call("array", listed(self.items(scope, parts(node)))))

    # Operations

    def _binary(self, scope: Scope, node: Node) -> Term:
        operator = text_of(field(node, "operator"))
        if operator not in (*OPERATORS, *ARITHMETIC, *LOGICAL):
            raise scope.refuse(node, f"the operator {operator} is not part of the language of labs")
        left, right = self.term(scope, field(node, "left")), self.term(scope, field(node, "right"))
        return self.chosen(operator, left, right) if operator in LOGICAL else self.combined(node, operator, left, right)

    def _unary(self, scope: Scope, node: Node) -> Term:
        operator = text_of(field(node, "operator"))
        if operator not in ("-", "+", "!", "~", "typeof"):
            raise scope.refuse(node, f"the operator {operator} is not part of the language of labs")
        term = self.term(scope, field(node, "argument"))
        if operator == "!":
            return Term(negated(self.truth(term)), Kind.BOOLEAN)
        if operator == "typeof":
            return Term(call("type_name", term.code))
        if operator == "-" and term.literal is not None:
            return Term(constant(-term.literal), Kind.NUMBER)
        code = self.number(term)
        if operator == "-":
            code = ast.UnaryOp(ast.USub(), code)
        return Term(call("complement", code) if operator == "~" else code, Kind.NUMBER)

    def _ternary(self, scope: Scope, node: Node) -> Term:
        test, yes, no = (self.term(scope, field(node, part)) for part in ("condition", "consequence", "alternative"))
        return Term(ast.IfExp(self.truth(test), yes.code, no.code), join(yes.kept, no.kept))

    def _sequence(self, scope: Scope, node: Node) -> Term:
        terms = [self.term(scope, part) for part in parts(node)]
        return Term(in_turn(*[term.code for term in terms]), terms[-1].kept)

    # Members and elements

    def at_path(self, scope: Scope, node: Node, path: Path) -> Term:
        """The value at a path. Raises Refused where it names nothing that may be read."""
        if path in paths.CONSTANTS:
            return Term(constant(paths.CONSTANTS[path]), Kind.NUMBER)
        if path in paths.WRITABLE:
            return Term(self.need("vector", path))
        if path[0] == "ctx" and len(path) == 2:
            key = paths.ctx_name(scope, node, path[1])
            self.need("ctx", (key,))
            return Term(item("ctx", constant(key)))
        if path[0] == "model" and len(path) == 2 and path[1] in fields.MODEL_SIZES:
            return Term(self.need("count", path), Kind.NUMBER)
        if path in paths.SCALARS:
            return Term(ast.Call(self.need("scalar", path), [], []), Kind.NUMBER)
        raise scope.refuse(node, f"{'.'.join(path)} cannot be read here")

    def _member(self, scope: Scope, node: Node) -> Term | Build:
        path = paths.path_of(node)
        if path is not None and not (path[-1] == "length" and len(path) > 2):
            return self.at_path(scope, node, path)
        key = text_of(field(node, "property"))
        if key not in RECORD_PARTS and key != "length":
            raise scope.refuse(field(node, "property"), f".{key} is not available")
        if path is not None and path[:-1] in paths.WRITABLE:
            return Term(self.need("size", path[:-1]), Kind.NUMBER)
        return lambda value: call("member", value, constant(key))

    def _subscript(self, scope: Scope, node: Node) -> Term | Build:
        path = self._field_of(scope, node)
        if path is not None and not is_optional(node):
            return self._element(node, path, self.term(scope, field(node, "index")))
        return lambda value: call("read_index", value, self.value_of(scope, field(node, "index")))

    def _field_of(self, scope: Scope, node: Node) -> Path | None:
        """The path of the field whose element a subscript names, if it is one. Square brackets take numbers."""
        path = paths.path_of(field(node, "object"))
        if path is not None and len(path) == 1:
            raise scope.refuse(node, "square brackets take the number of an element; name a field with a dot")
        if field(node, "index").type in ("string", "template_string"):
            raise scope.refuse(field(node, "index"), "square brackets take the number of an element")
        return path if path in paths.WRITABLE else None

    def _element(self, node: Node, path: Path, index: Term) -> Term:
        """An element of a field."""
        code = index.code
        if index.kind is not Kind.NUMBER or not paths.holds_floats(path):
            return self.located(node, call("read_index", self.need("vector", path), code))
        if index.literal is not None and index.literal >= 0 and index.literal.is_integer():
            within, key = compare(code, ast.Lt, self.need("size", path)), constant(int(index.literal))
        else:
            first, again = (code, lambda: name(code.id)) if isinstance(code, ast.Name) else self.held(code)
            within = compare(first, ast.In, self.need("positions", path))
            key = ast.Subscript(self.need("positions", path), again(), ast.Load())
        element = ast.Subscript(self.need("view", path), key, ast.Load())
        return Term(ast.IfExp(within, element, name("undefined")), Kind.ELEMENT)

    def _linked(self, scope: Scope, node: Node) -> Term:
        made = self.LINKS[node.type](self, scope, node)
        return made if isinstance(made, Term) else Term(self._chain(scope, node, made, lambda value: value))

    def _chain(self, scope: Scope, node: Node, build: Build, rest: Build) -> ast.expr:
        """The code of a chain up to `node`, which `build` makes, then its `rest`; undefined where `?.` cuts it."""
        link = field(node, "function") if node.type == "call_expression" else node
        owner = field(link, "object")

        def step(value: ast.expr) -> ast.expr:
            if not is_optional(link):
                return rest(self.located(node, build(value)).code)
            first, again = self.held(value)
            return ast.IfExp(_absent(first, again()), name("undefined"), rest(self.located(node, build(again())).code))

        before = self.LINKS[owner.type](self, scope, owner) if owner.type in self.LINKS else self.term(scope, owner)
        return step(before.code) if isinstance(before, Term) else self._chain(scope, owner, before, step)

    # Calls

    def _call(self, scope: Scope, node: Node) -> Term | Build:
        function, arguments = field(node, "function"), field(node, "arguments")
        if arguments.type != "arguments":
            raise scope.refuse(node, "tagged templates are not part of the language of labs")
        args, path = parts(arguments), host_path(function)
        if path is not None and not is_optional(node):
            return self._host_call(scope, node, path, args)
        if function.type == "identifier":
            return self._named_call(scope, node, function, args)
        if function.type != "member_expression":
            raise scope.refuse(node, "only functions that have a name can be called")
        return self._method_call(scope, node, function, args)

    def _host_call(self, scope: Scope, node: Node, path: Path, args: list[Node]) -> Term:
        function, machine = FUNCTIONS[path], name("machine")
        if tuple(text_of(arg) for arg in args[: len(function.takes)]) != function.takes:
            raise scope.refuse(node, f"{text_of(field(node, 'function'))} begins with {', '.join(function.takes)}")
        if path == ("Array", "from") and len(args) == 2:
            items, callback = listed(self.items(scope, args[:1])), self.function(scope, args[1])
            return self.located(node, call("map_from", machine, self.need("function", path), items, callback))
        rest = args[len(function.takes) :]
        plain = not any(arg.type == "spread_element" for arg in rest)
        if function.numeric is not None and plain and len(rest) <= (function.arity or len(rest)):
            numbers = [self.number(self.term(scope, arg)) for arg in rest]
            numbers += [name("nan")] * ((function.arity or 0) - len(numbers))
            made = ast.Call(self.need("numeric", path), numbers, [])
            return self.located(node, ast.IfExp(call("tick", machine), made, constant(0.0)), Kind.NUMBER)
        kind = {float: Kind.NUMBER, bool: Kind.BOOLEAN, None: Kind.ANY}[function.gives]
        items = listed(self.items(scope, rest))
        return self.located(node, call("host", machine, self.need("function", path), items), kind)

    def _named_call(self, scope: Scope, node: Node, function: Node, args: list[Node]) -> Term:
        text = text_of(function)
        if text in CONSTRUCTORS:
            raise scope.refuse(node, f"write new {text}(...)")
        if text in NO_FUNCTIONS or scope.find(function).kind != "function":
            raise scope.refuse(function, f"{text} is no function")
        return self.located(node, ast.Call(name(scope.find(function).name), self.items(scope, args), []))

    def _method_call(self, scope: Scope, node: Node, function: Node, args: list[Node]) -> Build:
        method, path = text_of(field(function, "property")), paths.path_of(field(function, "object"))
        if method not in METHODS or (path is not None and len(path) == 1):
            raise scope.refuse(function, f"{text_of(function)[:60]}() is not available")
        if method in ("set", "fill", "sort", "reverse") and paths.WRITABLE.get(path) is False:
            raise scope.refuse(node, f"{'.'.join(path or ())} can only be read")

        def build(value: ast.expr) -> ast.expr:
            callback = [self.function(scope, arg) for arg in args[:1]] if method in CALLBACK_METHODS else []
            if method in CALLBACK_METHODS - {"sort"} and not callback:
                raise scope.refuse(node, f"{method} needs a function")
            given = listed([*callback, *self.items(scope, args[len(callback) :])])
            return call("method", name("machine"), value, constant(method), given)

        return build

    def function(self, scope: Scope, node: Node) -> ast.expr:
        """The function that an argument is: an arrow function, or the name of one. Raises Refused for others."""
        if node.type == "arrow_function":
            return name(self.arrow(scope, node))
        path = host_path(node)
        if path is not None and not FUNCTIONS[path].takes:
            return self.need("callback", path)
        if node.type == "identifier" and text_of(node) not in NO_FUNCTIONS and scope.find(node).kind == "function":
            return name(scope.find(node).name)
        raise scope.refuse(node, "a function is needed here, such as x => 2 * x")

    @abstractmethod
    def arrow(self, scope: Scope, node: Node) -> str:
        """The name of the Python function that an arrow function becomes; compiled with the statements."""

    def _new(self, scope: Scope, node: Node) -> Term:
        """`new Array(n).fill(x)` and `new Float64Array(n)`; nothing else is constructed."""
        constructor, arguments = text_of(field(node, "constructor")), node.child_by_field_name("arguments")
        args = parts(arguments) if arguments is not None else []
        if constructor == "Float64Array":
            return self.located(node, call("typed_array", name("machine"), listed(self.items(scope, args))))
        parent = node.parent
        filled = parent is not None and parent.type == "member_expression"
        filled = filled and parent is not None and text_of(field(parent, "property")) == "fill"
        if constructor == "Array" and len(args) == 1 and args[0].type != "spread_element" and filled:
            return self.located(node, call("empty_array", name("machine"), self.value_of(scope, args[0])))
        raise scope.refuse(node, "only new Array(n).fill(x) and new Float64Array(n) are available")

    # Assignments

    def place(self, scope: Scope, node: Node, again: bool) -> Place:
        """What an assignment writes to, which is read `again` or not. Raises Refused where it cannot be written."""
        if node.type == "parenthesized_expression":
            return self.place(scope, parts(node)[0], again)
        if node.type == "subscript_expression" and not is_optional(node):
            return self._element_place(scope, node, again)
        path = paths.path_of(node)
        if node.type == "member_expression" and path is not None:
            return self._path_place(scope, node, path)
        if node.type != "identifier" or text_of(node) in NO_FUNCTIONS:
            raise scope.refuse(node, "this cannot be assigned")
        binding = scope.find(node)
        if binding.kind not in ("let", "var", "parameter"):
            raise scope.refuse(node, f"{text_of(node)} is constant")

        def write(new: ast.expr) -> ast.expr:
            return ast.NamedExpr(target(binding.name), new)

        return Place(lambda: self.variable(binding), write, binding=binding)

    def _path_place(self, scope: Scope, node: Node, path: Path) -> Place:
        def read() -> Term:
            return self.at_path(scope, node, path)

        match path:
            case ("ctx", key):
                read()
                return Place(read, lambda new: call("put", name("ctx"), constant(key), new))
            case ("model", "opt", option) if option in fields.OPTION_SCALARS:
                return Place(read, lambda new: ast.Call(self.need("option", path), [new], []))
            case ("data", "time"):
                return Place(read, lambda new: ast.Call(self.need("time", path), [new], []))
        if path in paths.WRITABLE:
            raise scope.refuse(node, f"{'.'.join(path)} is an array: assign its elements, or use .set() or .fill()")
        raise scope.refuse(node, f"{'.'.join(path)} cannot be assigned")

    def _element_place(self, scope: Scope, node: Node, again: bool) -> Place:
        path = self._field_of(scope, node)
        if path is not None and not paths.WRITABLE[path]:
            raise scope.refuse(node, f"{'.'.join(path)} can only be read")
        array, index = self.term(scope, field(node, "object")), self.term(scope, field(node, "index"))
        begin: list[ast.expr] = []
        for term in (array, index) if again else ():
            if not isinstance(term.code, ast.Constant) and (path is None or term is index):
                first, held = self.held(term.code)
                begin.append(first)
                term.kind, term.code = term.kept, held()
        if path is None:
            return Place(
                lambda: self.located(node, call("read_index", array.code, index.code)),
                lambda new: call("write_index", array.code, index.code, new),
                tuple(begin),
            )
        return Place(
            lambda: self._element(node, path, index),
            lambda new: ast.Call(self.need("write", path), [index.code, new], []),
            tuple(begin),
        )

    def written(self, scope: Scope, node: Node, place: Place, new: Term) -> Term:
        """The assignment of a value, which is the value of the assignment."""
        if place.binding is not None:
            self.stored(scope, place.binding, new)
        return self.located(node, place.write(new.code), new.kept)

    def _assignment(self, scope: Scope, node: Node) -> Term:
        place = self.place(scope, field(node, "left"), again=False)
        return self.written(scope, node, place, self.term(scope, field(node, "right")))

    def _augmented(self, scope: Scope, node: Node) -> Term:
        place, operator = self.place(scope, field(node, "left"), again=True), text_of(field(node, "operator"))[:-1]
        if operator not in (*OPERATORS, *ARITHMETIC, *LOGICAL):
            raise scope.refuse(node, f"the operator {operator}= is not part of the language of labs")
        right = self.term(scope, field(node, "right"))
        if operator in LOGICAL:
            made = self.chosen(operator, place.read(), self.written(scope, node, place, right))
        else:
            made = self.written(scope, node, place, self.combined(node, operator, place.read(), right))
        return Term(in_turn(*place.begin, made.code), made.kind)

    def update(self, scope: Scope, node: Node, old_value: bool) -> Term:
        """`place++` or `--place`: the old or the new value."""
        place = self.place(scope, field(node, "argument"), again=True)
        old, values = self.number(place.read()), list(place.begin)
        if old_value:
            old, again = self.held(old)
        one = Term(constant(1.0), Kind.NUMBER)
        new = self.combined(node, text_of(field(node, "operator"))[0], Term(old, Kind.NUMBER), one)
        values += [self.written(scope, node, place, new).code, *([again()] if old_value else [])]
        return Term(in_turn(*values), Kind.NUMBER)

    def _update(self, scope: Scope, node: Node) -> Term:
        return self.update(scope, node, old_value=node.children[0].type not in ("++", "--"))

    LINKS: ClassVar[dict[str, Callable[["Terms", Scope, Node], Term | Build]]] = {
        "member_expression": _member,
        "subscript_expression": _subscript,
        "call_expression": _call,
    }
    TERMS: ClassVar[dict[str, Callable[["Terms", Scope, Node], Term]]] = {
        **dict.fromkeys(LINKS, _linked),
        "parenthesized_expression": lambda self, scope, node: self.term(scope, parts(node)[0]),
        "number": lambda self, scope, node: Term(constant(number_of(self.source, node)), Kind.NUMBER),
        "string": lambda self, scope, node: Term(constant(string_of(self.source, node))),
        "template_string": _template,
        "true": lambda self, scope, node: Term(constant(True), Kind.BOOLEAN),
        "false": lambda self, scope, node: Term(constant(False), Kind.BOOLEAN),
        "null": lambda self, scope, node: Term(constant(None)),
        "undefined": lambda self, scope, node: Term(name("undefined")),
        "identifier": _identifier,
        "array": _array,
        "binary_expression": _binary,
        "unary_expression": _unary,
        "ternary_expression": _ternary,
        "sequence_expression": _sequence,
        "assignment_expression": _assignment,
        "augmented_assignment_expression": _augmented,
        "update_expression": _update,
        "new_expression": _new,
    }


def _absent(first: ast.expr, again: ast.expr) -> ast.expr:
    """Whether a value is null or undefined."""
    return ast.BoolOp(ast.Or(), [compare(first, ast.Is, constant(None)), compare(again, ast.Is, name("undefined"))])
