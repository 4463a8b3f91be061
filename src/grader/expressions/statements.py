"""Statements: each becomes one or more Python statements."""

import ast
from collections.abc import Callable
from typing import ClassVar

from tree_sitter import Node

from grader.expressions.code import (
    Kind,
    Term,
    assign,
    call,
    compare,
    constant,
    function,
    item,
    name,
    negated,
    pay,
    target,
)
from grader.expressions.machine import TICKS_PER_EVALUATION, TICKS_PER_RUN
from grader.expressions.scope import Binding, Scope
from grader.expressions.syntax import expression_of, field, parts, text_of
from grader.expressions.terms import Terms

Statements = list[ast.stmt]
LOOPS_MAX = 15
"""How deep loops may nest. Source: CPython allows 20 blocks in each other."""


class Compiler(Terms):
    """Compiles one text, whole."""

    loops = 0

    def program(self, scope: Scope, kind: str) -> ast.Module:
        """A module with one function, `make`, which takes what a machine binds and gives the function that runs."""
        if kind == "statement":
            body = self.body(scope, self.source.root)
        else:
            result = ast.Return(self.value_of(scope, expression_of(self.source)))
            body = [*scope.frame.functions, result]
        if _pays(body):
            body = [_begin(), *body]
        failing = ast.Raise(call("failed", name("error")), None)
        attempt = ast.Try(body, [ast.ExceptHandler(name("failure"), "error", [failing])], [], [])
        run = function("run", ["given"], [attempt], lenient=True)
        bound = ["machine", "budget", "ctx", "failure", "failed", *self.needs.values()]
        return ast.Module([function("make", bound, [run, ast.Return(name("run"))])], [])

    def body(self, scope: Scope, node: Node) -> Statements:
        """The block of a function, or a whole program."""
        bindings = [scope.declare(variable, "var", ready=True) for variable in _variables(scope, node)]
        begin = [self.declared(scope, binding, Term(name("undefined"))) for binding in bindings]
        block = self.block(scope, parts(node))
        return [*begin, *scope.frame.functions, *block, ast.Return(name("undefined"))]

    def declared(self, scope: Scope, binding: Binding, term: Term) -> ast.stmt:
        """A variable with its first value."""
        self.stored(scope, binding, term)
        binding.ready = True
        return assign(binding.name, term.code)

    def block(self, scope: Scope, nodes: list[Node]) -> Statements:
        """Statements of one block; its names are declared first, so that none is used too early."""
        for node in nodes:
            if node.type == "lexical_declaration":
                for variable in _declared(scope, node):
                    scope.declare(variable, text_of(node.children[0]))
        return [statement for node in nodes for statement in self.statement(scope, node)]

    def statement(self, scope: Scope, node: Node) -> Statements:
        """The code of one statement. Raises Refused for what the language does not have."""
        compiler = self.STATEMENTS.get(node.type)
        if compiler is None:
            raise scope.refuse(node, f"{node.type.replace('_', ' ')} is not part of the language of labs")
        return compiler(self, scope, node)

    def _governed(self, scope: Scope, node: Node) -> Statements:
        """The statement that an `if` or a loop governs, which cannot be a declaration."""
        if node.type == "lexical_declaration":
            raise scope.refuse(node, "a declaration needs a block here")
        return self.statement(scope, node)

    def _expression(self, scope: Scope, node: Node) -> Statements:
        """An expression whose value is not used."""
        inner = parts(node)[0] if node.type == "expression_statement" else node
        term = self.update(scope, inner, False) if inner.type == "update_expression" else self.term(scope, inner)
        return [ast.Expr(term.code)]

    def _declaration(self, scope: Scope, node: Node) -> Statements:
        kind = text_of(node.children[0])
        return [made for part in parts(node) for made in self._declarator(scope, part, kind)]

    def _declarator(self, scope: Scope, node: Node, kind: str) -> Statements:
        variable, value = field(node, "name"), node.child_by_field_name("value")
        if variable.type == "array_pattern" and value is not None:
            return self._unpack(scope, variable, value)
        if value is not None and value.type == "arrow_function":
            if kind != "const":
                raise scope.refuse(node, "declare a function with const")
            binding = scope.names[text_of(variable)]
            binding.name = self.arrow(scope, value)
            binding.kind, binding.ready = "function", True
            return []
        if value is None and (kind == "const" or variable.type == "array_pattern"):
            raise scope.refuse(node, f"{text_of(variable)} needs a value")
        if value is None and kind == "var":
            return []
        term = Term(name("undefined")) if value is None else self.term(scope, value)
        return [self.declared(scope, self._binding(scope, variable), term)]

    def _binding(self, scope: Scope, variable: Node) -> Binding:
        """The variable that a declaration names; `var` has declared it for the whole function."""
        return scope.names.get(text_of(variable)) or scope.find(variable)

    def _unpack(self, scope: Scope, pattern: Node, value: Node) -> Statements:
        """`const [x, y] = array`."""
        names, kept = parts(pattern), self.temporary()
        unpacked = self.located(value, call("unpack", self.value_of(scope, value), constant(len(names))))
        elements = [Term(item(kept, constant(i))) for i in range(len(names))]
        bindings = [self._binding(scope, variable) for variable in names]
        return [assign(kept, unpacked.code), *map(self.declared, [scope] * len(names), bindings, elements)]

    def _block(self, scope: Scope, node: Node) -> Statements:
        return self.block(scope.inner(), parts(node))

    def _if(self, scope: Scope, node: Node) -> Statements:
        test = self.truth(self.term(scope, field(node, "condition")))
        body = self._governed(scope, field(node, "consequence"))
        otherwise = node.child_by_field_name("alternative")
        orelse = [] if otherwise is None else self._governed(scope, parts(otherwise)[0])
        return [ast.If(test, body or [ast.Pass()], orelse)]

    # Loops

    def _turn(self, scope: Scope, node: Node) -> Statements:
        """The body of a loop, with a tick before each turn, so that it ends."""
        if self.loops >= LOOPS_MAX:
            raise scope.refuse(node, f"loops nested more than {LOOPS_MAX} deep")
        self.loops += 1
        body = self._governed(scope, node)
        self.loops -= 1
        ticking = pay()
        for statement in ticking:
            self.at(node.parent or node, statement)
        return [*ticking, *body]

    def _while(self, scope: Scope, node: Node) -> Statements:
        test = self.truth(self.term(scope, field(node, "condition")))
        return [ast.While(test, self._turn(scope.inner(in_loop=True), field(node, "body")), [])]

    def _do(self, scope: Scope, node: Node) -> Statements:
        test = self.truth(self.term(scope, field(node, "condition")))
        return self._repeated(constant(True), _leave(test), self._turn(scope.inner(in_loop=True), field(node, "body")))

    def _repeated(self, test: ast.expr, after: Statements, body: Statements) -> Statements:
        """A loop that does what comes `after` a turn before the next one, also after `continue`."""
        begun = self.temporary()
        between = ast.If(name(begun), after, [assign(begun, constant(True))])
        return [assign(begun, constant(False)), ast.While(constant(True), [between, *_leave(test), *body], [])]

    def _for(self, scope: Scope, node: Node) -> Statements:
        inside = scope.inner(in_loop=True)
        first, condition, update = (node.child_by_field_name(f) for f in ("initializer", "condition", "increment"))
        begin: Statements = []
        if first is not None:
            is_statement = first.type in self.STATEMENTS
            begin = self.block(inside, [first]) if is_statement else self._expression(inside, first)
        test = constant(True)
        if condition is not None and condition.type != "empty_statement":
            test = self.truth(self.term(inside, _clause(condition)))
        after = [] if update is None else self._expression(inside, update)
        body = self._turn(inside, field(node, "body"))
        if not after:
            return [*begin, ast.While(test, body, [])]
        return [*begin, *self._repeated(test, after, body)]

    def _for_of(self, scope: Scope, node: Node) -> Statements:
        kind, variable = node.child_by_field_name("kind"), field(node, "left")
        if text_of(field(node, "operator")) != "of" or kind is None or variable.type != "identifier":
            raise scope.refuse(node, "write for (const x of array)")
        entry, word = self.temporary(), text_of(kind)
        items = self.located(node, call("through", self.value_of(scope, field(node, "right"))))
        inside = scope.inner(in_loop=True)
        binding = scope.find(variable) if word == "var" else inside.declare(variable, word, ready=True)
        bound = self.declared(inside, binding, Term(name(entry)))
        return [ast.For(target(entry), items.code, [bound, *self._turn(inside, field(node, "body"))], [])]

    def _jump(self, scope: Scope, node: Node) -> Statements:
        """`break` and `continue`, without labels."""
        word = text_of(node.children[0])
        if not scope.in_loop or node.child_by_field_name("label") is not None:
            raise scope.refuse(node, f"{word} stands alone, inside a loop")
        return [ast.Break() if word == "break" else ast.Continue()]

    def _return(self, scope: Scope, node: Node) -> Statements:
        values = parts(node)
        return [ast.Return(self.value_of(scope, values[0]) if values else name("undefined"))]

    # Functions

    def arrow(self, scope: Scope, node: Node) -> str:
        """The name of the Python function that an arrow function of plain parameters becomes."""
        single = node.child_by_field_name("parameter")
        names = [single] if single is not None else parts(field(node, "parameters"))
        inside = scope.function()
        if any(variable.type != "identifier" for variable in names) or any(c.type == "async" for c in node.children):
            raise scope.refuse(node, "a function here has plain parameters only")
        parameters = [inside.declare(variable, "parameter", ready=True) for variable in names]
        self.found |= {parameter.name: Kind.ANY for parameter in parameters}
        body = field(node, "body")
        loops, self.loops = self.loops, 0
        if body.type == "statement_block":
            code = self.body(inside, body)
        else:
            result = ast.Return(self.value_of(inside, body))
            code = [*inside.frame.functions, result]
        self.loops = loops
        identifier, outer = self.temporary("f"), sorted(inside.frame.outer)
        nonlocals: Statements = [ast.Nonlocal(outer)] if outer else []
        called = [parameter.name for parameter in parameters]
        scope.frame.functions.append(function(identifier, called, [*nonlocals, *pay(), *code], lenient=True))
        return identifier

    STATEMENTS: ClassVar[dict[str, Callable[["Compiler", Scope, Node], Statements]]] = {
        "expression_statement": _expression,
        "empty_statement": lambda self, scope, node: [],
        "lexical_declaration": _declaration,
        "variable_declaration": _declaration,
        "statement_block": _block,
        "if_statement": _if,
        "while_statement": _while,
        "do_statement": _do,
        "for_statement": _for,
        "for_in_statement": _for_of,
        "break_statement": _jump,
        "continue_statement": _jump,
        "return_statement": _return,
    }


def _begin() -> ast.stmt:
    """A fresh budget for this evaluation, within what the whole run may use."""
    used = item("budget", constant(0))
    fresh = ast.BinOp(used, ast.Add(), constant(TICKS_PER_EVALUATION))
    roomy = compare(used, ast.Lt, constant(TICKS_PER_RUN - TICKS_PER_EVALUATION))
    limit = ast.Subscript(name("budget"), constant(1), ast.Store())
    return ast.Assign([limit], ast.IfExp(roomy, fresh, constant(TICKS_PER_RUN)))


def _pays(body: Statements) -> bool:
    """Whether any code may use the budget: it names the budget or the machine."""
    names = (node.id for statement in body for node in ast.walk(statement) if isinstance(node, ast.Name))
    return any(identifier in ("budget", "machine") for identifier in names)


def _leave(test: ast.expr) -> Statements:
    """What ends a loop where the test fails."""
    return [ast.If(negated(test), [ast.Break()], [])]


def _clause(node: Node) -> Node:
    return parts(node)[0] if node.type == "expression_statement" else node


def _declared(scope: Scope, node: Node) -> list[Node]:
    """The names that a declaration declares."""
    names: list[Node] = []
    for declarator in parts(node):
        variable = field(declarator, "name")
        names += parts(variable) if variable.type == "array_pattern" else [variable]
    for variable in names:
        if variable.type != "identifier":
            raise scope.refuse(variable.parent or variable, "only plain names can be inside [ ] here")
    return names


def _variables(scope: Scope, node: Node) -> list[Node]:
    """The names declared with `var` anywhere in a function, which see them from its beginning."""
    found: list[Node] = []
    for child in parts(node):
        if child.type == "variable_declaration":
            found.extend(_declared(scope, child))
        elif child.type == "for_in_statement" and child.children[2].type == "var":
            found.append(field(child, "left"))
        if child.type != "arrow_function":
            found.extend(_variables(scope, child))
    return found
