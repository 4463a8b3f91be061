"""Statements: each becomes one or more Python statements. `_statement_x` compiles the grammar's node type `x`."""

import ast

from tree_sitter import Node

from grader.expressions.compiling.assignments import Assignments
from grader.expressions.compiling.code import PAY, Term, ValueKind, build_expression, build_name, build_statements
from grader.expressions.compiling.scope import Binding, Scope
from grader.expressions.compiling.syntax import FUNCTIONS, SyntaxRefused, get_field, list_parts, read_text
from grader.expressions.machine import TICKS_PER_EVALUATION, TICKS_PER_RUN

Statements = list[ast.stmt]
LOOPS_MAX = 15
"""How deep loops may nest. Source: CPython allows 20 blocks in each other."""

MAKE = """
def make(machine, budget, ctx, failure, failed):
    def run(given=undefined, *r0):
        try:
            BODY
        except failure as error:
            raise failed(error)
    return run
"""
BEGIN = f"""
budget[1] = (
    budget[0] + {TICKS_PER_EVALUATION} if budget[0] < {TICKS_PER_RUN - TICKS_PER_EVALUATION} else {TICKS_PER_RUN}
)
"""
"""A fresh budget for an evaluation, within what the whole run may use."""

REPEATED = """
BEGUN = False
while True:
    if BEGUN:
        AFTER
    else:
        BEGUN = True
    if not TEST:
        break
    BODY
"""
"""A loop that does what comes after a turn before the next one, also after `continue`."""


class Compiler(Assignments):
    """Compiles one text, whole."""

    loops = 0

    def program(self, scope: Scope, tree: Node) -> ast.Module:
        """A module with one function, `make`, which takes what a machine binds and gives the function that runs."""
        body = self.body(scope, tree) if tree.type == "program" else self._result(scope, tree)
        begin = build_statements(BEGIN) if _uses_budget(body) else []
        module = ast.Module(build_statements(MAKE, BODY=[*begin, *body]), [])
        (make,) = module.body
        assert isinstance(make, ast.FunctionDef)
        make.args.args += [ast.arg(bound) for bound in self.needs.values()]
        return module

    def _result(self, scope: Scope, node: Node) -> Statements:
        """Returns the body of a function that gives an expression."""
        result = ast.Return(self.value_of(scope, node))
        return [*scope.frame.functions, result]

    def body(self, scope: Scope, node: Node) -> Statements:
        """Returns the block of a function, or a whole program."""
        bindings = [scope.declare(variable, "var", ready=True) for variable in _list_variables(node)]
        begin = [self.declared(scope, binding, Term(build_name("undefined"))) for binding in bindings]
        block = self.block(scope, list_parts(node))
        return [*begin, *scope.frame.functions, *block, ast.Return(build_name("undefined"))]

    def declared(self, scope: Scope, binding: Binding, term: Term) -> ast.stmt:
        """Returns a variable with its first value."""
        self.stored(scope, binding, term)
        binding.ready = True
        return ast.Assign([ast.Name(binding.name, ast.Store())], term.code)

    def block(self, scope: Scope, nodes: list[Node]) -> Statements:
        """Statements of one block; its names are declared first, so that none is used too early."""
        for node in nodes:
            if node.type == "lexical_declaration":
                for variable in _list_declared(node):
                    scope.declare(variable, read_text(node.children[0]))
        return [statement for node in nodes for statement in self.statement(scope, node)]

    def statement(self, scope: Scope, node: Node) -> Statements:
        """Returns the code of one statement. Raises SyntaxRefused for what the language does not have."""
        compiled: Statements = self.compiled("_statement", scope, node)
        return compiled

    def _governed(self, scope: Scope, node: Node) -> Statements:
        """Returns the statement that an `if` or a loop governs, which cannot be a declaration."""
        if node.type == "lexical_declaration":
            raise SyntaxRefused(node, "a declaration needs a block here")
        return self.statement(scope, node)

    def _statement_expression_statement(self, scope: Scope, node: Node) -> Statements:
        return self._effect(scope, list_parts(node)[0])

    def _effect(self, scope: Scope, node: Node) -> Statements:
        """Returns a statement, or an expression whose value is not used."""
        if node.type.endswith(("_statement", "_declaration")):
            return self.block(scope, [node])
        term = self.update(scope, node, False) if node.type == "update_expression" else self.term(scope, node)
        return [ast.Expr(term.code)]

    def _statement_statement_block(self, scope: Scope, node: Node) -> Statements:
        return self.block(scope.inner(), list_parts(node))

    _statement_empty_statement = _statement_statement_block

    def _statement_lexical_declaration(self, scope: Scope, node: Node) -> Statements:
        kind = read_text(node.children[0])
        return [statement for part in list_parts(node) for statement in self._declarator(scope, part, kind)]

    _statement_variable_declaration = _statement_lexical_declaration

    def _declarator(self, scope: Scope, node: Node, kind: str) -> Statements:
        variable, value = get_field(node, "name"), node.child_by_field_name("value")
        if variable.type == "array_pattern" and value is not None:
            return self._unpack(scope, variable, value)
        if value is not None and value.type in FUNCTIONS:
            if kind != "const":
                raise SyntaxRefused(node, "declare a function with const")
            binding = scope.names[read_text(variable)]
            binding.name = self.arrow(scope, value)
            binding.kind, binding.ready = "function", True
            return []
        if value is None and (kind == "const" or variable.type == "array_pattern"):
            raise SyntaxRefused(node, f"{read_text(variable)} needs a value")
        if value is None and kind == "var":
            return []
        term = Term(build_name("undefined")) if value is None else self.term(scope, value)
        return [self.declared(scope, self._binding(scope, variable), term)]

    def _binding(self, scope: Scope, variable: Node) -> Binding:
        """Returns the variable that a declaration names; `var` has declared it for the whole function."""
        return scope.names.get(read_text(variable)) or scope.find(variable)

    def _unpack(self, scope: Scope, pattern: Node, value: Node) -> Statements:
        """`const [x, y] = array`."""
        variables, kept = list_parts(pattern), self.temporary()
        text = f"(KEPT := unpack(VALUE, {len(variables)}))"
        unpacked = self.located(value, text, KEPT=kept, VALUE=self.value_of(scope, value))
        elements = [Term(build_expression(f"KEPT[{i}]", KEPT=kept)) for i in range(len(variables))]
        bindings = [self._binding(scope, variable) for variable in variables]
        return [ast.Expr(unpacked.code), *map(self.declared, [scope] * len(variables), bindings, elements)]

    def _statement_if_statement(self, scope: Scope, node: Node) -> Statements:
        test = self.truth(self.term(scope, get_field(node, "condition")))
        body = self._governed(scope, get_field(node, "consequence"))
        otherwise = node.child_by_field_name("alternative")
        orelse = [] if otherwise is None else self._governed(scope, list_parts(otherwise)[0])
        return [ast.If(test, body or [ast.Pass()], orelse)]

    def _statement_return_statement(self, scope: Scope, node: Node) -> Statements:
        values = list_parts(node)
        return [ast.Return(self.value_of(scope, values[0]) if values else build_name("undefined"))]

    # Loops

    def _turn(self, scope: Scope, node: Node) -> Statements:
        """Returns the body of a loop, with a tick before each turn, so that it ends."""
        if self.loops >= LOOPS_MAX:
            raise SyntaxRefused(node, f"loops nested more than {LOOPS_MAX} deep")
        self.loops += 1
        body = self._governed(scope, get_field(node, "body"))
        self.loops -= 1
        ticking = build_statements(PAY)
        for statement in ticking:
            self.at(node, statement)
        return [*ticking, *body]

    def _statement_for_statement(self, scope: Scope, node: Node) -> Statements:
        """`for`, and the loops that are one with parts missing: `while`, and `do`, which tests after its turn."""
        inside = scope.inner(in_loop=True)
        first, condition, update = (node.child_by_field_name(f) for f in ("initializer", "condition", "increment"))
        begin = [] if first is None else self._effect(inside, first)
        test: ast.expr = ast.Constant(True)
        if condition is not None and condition.type != "empty_statement":
            test = self.truth(self.term(inside, condition))
        after = [] if update is None else self._effect(inside, update)
        if node.type == "do_statement":
            test, after = ast.Constant(True), build_statements("if not TEST: break", TEST=test)
        body = self._turn(inside, node)
        if not after:
            return [*begin, ast.While(test, body, [])]
        return [*begin, *build_statements(REPEATED, BEGUN=self.temporary(), TEST=test, AFTER=after, BODY=body)]

    _statement_while_statement = _statement_do_statement = _statement_for_statement

    def _statement_for_in_statement(self, scope: Scope, node: Node) -> Statements:
        kind, variable = node.child_by_field_name("kind"), get_field(node, "left")
        if read_text(get_field(node, "operator")) != "of" or kind is None or variable.type != "identifier":
            raise SyntaxRefused(node, "write for (const x of array)")
        entry, word = self.temporary(), read_text(kind)
        items = self.located(node, "through(V)", V=self.value_of(scope, get_field(node, "right")))
        inside = scope.inner(in_loop=True)
        binding = scope.find(variable) if word == "var" else inside.declare(variable, word, ready=True)
        body = [self.declared(inside, binding, Term(build_name(entry))), *self._turn(inside, node)]
        return build_statements("for ENTRY in ITEMS: BODY", ENTRY=entry, ITEMS=items.code, BODY=body)

    def _statement_break_statement(self, scope: Scope, node: Node) -> Statements:
        word = read_text(node.children[0])
        if not scope.in_loop or node.child_by_field_name("label") is not None:
            raise SyntaxRefused(node, f"{word} stands alone, inside a loop")
        return build_statements(word)

    _statement_continue_statement = _statement_break_statement

    # Functions

    def arrow(self, scope: Scope, node: Node) -> str:
        """Returns the name of the Python function that a function of plain parameters becomes."""
        single = node.child_by_field_name("parameter")
        names = [single] if single is not None else list_parts(get_field(node, "parameters"))
        inside = scope.function()
        if any(variable.type != "identifier" for variable in names) or any(c.type == "async" for c in node.children):
            raise SyntaxRefused(node, "a function here has plain parameters only")
        parameters = [inside.declare(variable, "parameter", ready=True).name for variable in names]
        self.variable_kinds |= dict.fromkeys(parameters, ValueKind.ANY)
        body = get_field(node, "body")
        loops, self.loops = self.loops, 0
        statements = self.body(inside, body) if body.type == "statement_block" else self._result(inside, body)
        self.loops = loops
        identifier, outer = self.temporary("f"), sorted(inside.frame.outer)
        nonlocals = f"nonlocal {', '.join(outer)}" if outer else ""
        taken = "".join(f"{parameter}=undefined, " for parameter in parameters)
        text = f"def {identifier}({taken}*r0):\n {nonlocals}\n PAY\n BODY"
        scope.frame.functions += build_statements(text, PAY=build_statements(PAY), BODY=statements)
        return identifier


def _uses_budget(body: Statements) -> bool:
    """Whether any code may use the budget: it names the budget or the machine."""
    names = (node.id for statement in body for node in ast.walk(statement) if isinstance(node, ast.Name))
    return any(identifier in ("budget", "machine") for identifier in names)


def _list_declared(node: Node) -> list[Node]:
    """Returns the names that a declaration declares."""
    names: list[Node] = []
    for declarator in list_parts(node):
        variable = get_field(declarator, "name")
        names += list_parts(variable) if variable.type == "array_pattern" else [variable]
    for variable in names:
        if variable.type != "identifier":
            raise SyntaxRefused(variable.parent or variable, "only plain names can be inside [ ] here")
    return names


def _list_variables(node: Node) -> list[Node]:
    """Returns the names declared with `var` anywhere in a function, which see them from its beginning."""
    nodes: list[Node] = []
    for child in list_parts(node):
        if child.type == "variable_declaration":
            nodes.extend(_list_declared(child))
        elif child.type == "for_in_statement" and child.children[2].type == "var":
            nodes.append(get_field(child, "left"))
        if child.type not in FUNCTIONS:
            nodes.extend(_list_variables(child))
    return nodes
