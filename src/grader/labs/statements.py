"""Statements: each becomes a closure that returns None, or how control leaves it."""

from tree_sitter import Node

from grader.labs import calls, targets
from grader.labs.blocks import BREAK, CONTINUE, RETURN, compile_block
from grader.labs.dispatch import STATEMENTS, Step, compile_statement, compile_term, located
from grader.labs.machine import Machine
from grader.labs.scope import Code, Scope
from grader.labs.syntax import field, parts, text_of
from grader.labs.values import UNDEFINED, Trouble, Value, Vector, to_boolean


def _body(scope: Scope, node: Node) -> Step:
    """The statement that an `if` or a loop governs, which cannot be a declaration."""
    if node.type == "lexical_declaration":
        raise scope.refuse(node, "a declaration needs a block here")
    return compile_statement(scope, node)


def _doing(code: Code) -> Step:
    def run(m: Machine) -> None:
        code(m)

    return run


def _expression(scope: Scope, node: Node) -> Step:
    return _doing(compile_term(scope, parts(node)[0]))


def _nothing(scope: Scope, node: Node) -> Step:
    return lambda m: None


def _declaration(scope: Scope, node: Node) -> Step:
    kind = text_of(node.children[0])
    actions = [action for part in parts(node) if (action := _declarator(scope, part, kind)) is not None]

    def run(m: Machine) -> None:
        for action in actions:
            action(m)

    return run


def _declarator(scope: Scope, node: Node, kind: str) -> Step | None:
    name, value = field(node, "name"), node.child_by_field_name("value")
    if name.type == "array_pattern" and value is not None:
        return _unpack(scope, name, value)
    if value is not None and value.type == "arrow_function":
        if kind != "const":
            raise scope.refuse(node, "declare a function with const")
        binding = scope.names[text_of(name)]
        binding.maker, binding.kind, binding.ready = calls.compile_arrow(scope, value), "function", True
        return None
    if value is None and (kind == "const" or name.type == "array_pattern"):
        raise scope.refuse(node, f"{text_of(name)} needs a value")
    if value is None and kind == "var":
        return None
    code: Code = compile_term(scope, value) if value is not None else lambda m: UNDEFINED
    binding = scope.names[text_of(name)] if kind != "var" else scope.find(name)
    binding.ready, slot = True, binding.slot

    def run(m: Machine) -> None:
        m.slots[slot] = code(m)

    return run


def _unpack(scope: Scope, pattern: Node, value: Node) -> Step:
    """`const [x, y] = array`."""
    code = compile_term(scope, value)
    slots = []
    for name in parts(pattern):
        binding = scope.names.get(text_of(name)) or scope.find(name)
        binding.ready = True
        slots.append(binding.slot)

    def run(m: Machine) -> Value:
        array = code(m)
        if not isinstance(array, list | Vector):
            raise Trouble("only an array can be taken apart")
        for i, slot in enumerate(slots):
            m.slots[slot] = targets.read_index(array, float(i))
        return UNDEFINED

    return _doing(located(scope, value, run))


def _block(scope: Scope, node: Node) -> Step:
    return compile_block(scope.inner(), parts(node))


def _if(scope: Scope, node: Node) -> Step:
    condition = compile_term(scope, field(node, "condition"))
    yes = _body(scope, field(node, "consequence"))
    otherwise = node.child_by_field_name("alternative")
    no: Step = _body(scope, parts(otherwise)[0]) if otherwise is not None else lambda m: None
    return lambda m: yes(m) if to_boolean(condition(m)) else no(m)


def _loop(before: Code, body: Step, after: Code, check_first: bool = True) -> Step:
    """Repeats the body while `before` is true. Every turn uses a tick, so that no loop is endless."""

    def run(m: Machine) -> str | None:
        first = not check_first
        while first or to_boolean(before(m)):
            first = False
            m.tick()
            left = body(m)
            if left is BREAK:
                break
            if left is RETURN:
                return left
            after(m)
        return None

    return run


def _while(scope: Scope, node: Node) -> Step:
    condition = compile_term(scope, field(node, "condition"))
    body = _body(scope.inner(in_loop=True), field(node, "body"))
    loop = _loop(condition, body, lambda m: UNDEFINED, check_first=node.type == "while_statement")
    return located(scope, node, loop)


def _for(scope: Scope, node: Node) -> Step:
    inside = scope.inner(in_loop=True)
    begin_node, test_node, after_node = (node.child_by_field_name(f) for f in ("initializer", "condition", "increment"))
    begin: Step = lambda m: None  # noqa: E731
    if begin_node is not None and begin_node.type in ("lexical_declaration", "variable_declaration"):
        begin = compile_block(inside, [begin_node])
    elif begin_node is not None and begin_node.type != "empty_statement":
        begin = _doing(_clause(inside, begin_node))
    test: Code = lambda m: True  # noqa: E731
    if test_node is not None and test_node.type != "empty_statement":
        test = _clause(inside, test_node)
    after: Code = _clause(inside, after_node) if after_node is not None else lambda m: UNDEFINED
    loop = _loop(test, _body(inside, field(node, "body")), after)

    def run(m: Machine) -> str | None:
        begin(m)
        return loop(m)

    return located(scope, node, run)


def _clause(scope: Scope, node: Node) -> Code:
    return compile_term(scope, parts(node)[0] if node.type == "expression_statement" else node)


def _for_of(scope: Scope, node: Node) -> Step:
    kind, name = node.child_by_field_name("kind"), field(node, "left")
    if text_of(field(node, "operator")) != "of" or kind is None or name.type != "identifier":
        raise scope.refuse(node, "write for (const x of array)")
    items, inside = compile_term(scope, field(node, "right")), scope.inner(in_loop=True)
    word = text_of(kind)
    binding = scope.find(name) if word == "var" else inside.declare(name, word, ready=True)
    body, slot = _body(inside, field(node, "body")), binding.slot

    def run(m: Machine) -> str | None:
        array = items(m)
        if not isinstance(array, list | Vector):
            raise Trouble("for ... of goes through an array")
        k = 0
        while k < (len(array) if isinstance(array, list) else array.array.size):
            m.tick()
            m.slots[slot] = targets.read_index(array, float(k))
            k += 1
            left = body(m)
            if left is BREAK:
                break
            if left is RETURN:
                return left
        return None

    return located(scope, node, run)


def _jump(scope: Scope, node: Node) -> Step:
    """`break` and `continue`, without labels."""
    word = text_of(node.children[0])
    if not scope.in_loop or node.child_by_field_name("label") is not None:
        raise scope.refuse(node, f"{word} stands alone, inside a loop")
    left = BREAK if word == BREAK else CONTINUE
    return lambda m: left


def _return(scope: Scope, node: Node) -> Step:
    values = parts(node)
    code: Code = compile_term(scope, values[0]) if values else lambda m: UNDEFINED

    def run(m: Machine) -> str:
        m.returned = code(m)
        return RETURN

    return run


STATEMENTS.update(
    {
        "expression_statement": _expression,
        "empty_statement": _nothing,
        "lexical_declaration": _declaration,
        "variable_declaration": _declaration,
        "statement_block": _block,
        "if_statement": _if,
        "while_statement": _while,
        "do_statement": _while,
        "for_statement": _for,
        "for_in_statement": _for_of,
        "break_statement": _jump,
        "continue_statement": _jump,
        "return_statement": _return,
    }
)
