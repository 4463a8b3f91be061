"""Expressions: each node of the tree becomes one Python closure over the machine."""

from collections.abc import Callable

from tree_sitter import Node

from grader.labs import calls, paths, targets
from grader.labs.dispatch import EXPRESSIONS, compile_term, located
from grader.labs.machine import Machine
from grader.labs.operators import BINARY
from grader.labs.scope import Code, Scope
from grader.labs.syntax import escape_of, field, number_of, parts, string_of, text_of
from grader.labs.values import (
    UNDEFINED,
    Trouble,
    Value,
    bounded,
    bounded_list,
    in_units,
    to_boolean,
    to_int32,
    to_number,
    to_string,
    type_name,
    weight,
)

NAMED_CONSTANTS: dict[str, Value] = {"undefined": UNDEFINED, "NaN": float("nan"), "Infinity": float("inf")}
FAST: dict[str, Callable[[float, float], Value]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "===": lambda a, b: a == b,
    "!==": lambda a, b: a != b,
}
"""Where two numbers mean the same in Python."""


def _constant(value: Value) -> Code:
    return lambda m: value


def _parentheses(scope: Scope, node: Node) -> Code:
    return compile_term(scope, parts(node)[0])


def _identifier(scope: Scope, node: Node) -> Code:
    name = text_of(node)
    if name in NAMED_CONSTANTS:
        return _constant(NAMED_CONSTANTS[name])
    if name == "value":
        return lambda m: m.value
    if name in paths.ROOTS or calls.is_function(scope, node):
        raise scope.refuse(node, f"{name} cannot be used as a value")
    slot = scope.find(node).slot
    return lambda m: m.slots[slot]


def _template(scope: Scope, node: Node) -> Code:
    pieces: list[Code] = []
    for child in parts(node):
        if child.type == "template_substitution":
            pieces.append(compile_term(scope, parts(child)[0]))
        elif child.type == "escape_sequence":
            pieces.append(_constant(in_units(escape_of(scope.source, child))))
        else:
            pieces.append(_constant(in_units(text_of(child).replace("\r\n", "\n").replace("\r", "\n"))))

    def run(m: Machine) -> Value:
        values = [piece(m) for piece in pieces]
        m.tick(sum(map(weight, values)))
        return bounded("".join(map(to_string, values)))

    return located(scope, node, run)


def _array(scope: Scope, node: Node) -> Code:
    items = calls.compile_items(scope, parts(node))
    return located(scope, node, lambda m: bounded_list(items(m)))


def binary(operator: str, left: Code, right: Code) -> Code:
    """Code for `left operator right`, both always evaluated."""
    general, fast = BINARY[operator], FAST.get(operator)

    def slow(m: Machine, a: Value, b: Value) -> Value:
        m.tick(weight(a) + weight(b))
        return general(a, b)

    def run(m: Machine) -> Value:
        a = left(m)
        b = right(m)
        return slow(m, a, b)

    def run_fast(m: Machine) -> Value:
        a = left(m)
        b = right(m)
        if type(a) is float and type(b) is float:
            return quick(a, b)
        return slow(m, a, b)

    if fast is None:
        return run
    quick = fast
    return run_fast


def logical(operator: str, left: Code, right: Code) -> Code:
    """Code for `&&`, `||` and `??`, which evaluate the right side only where it counts."""

    def both(m: Machine) -> Value:
        a = left(m)
        return right(m) if to_boolean(a) else a

    def either(m: Machine) -> Value:
        a = left(m)
        return a if to_boolean(a) else right(m)

    def default(m: Machine) -> Value:
        a = left(m)
        return right(m) if a is None or a is UNDEFINED else a

    return {"&&": both, "||": either, "??": default}[operator]


def _binary(scope: Scope, node: Node) -> Code:
    operator = text_of(field(node, "operator"))
    if operator not in BINARY and operator not in ("&&", "||", "??"):
        raise scope.refuse(node, f"the operator {operator} is not part of the language of labs")
    left, right = compile_term(scope, field(node, "left")), compile_term(scope, field(node, "right"))
    if operator in BINARY:
        return located(scope, node, binary(operator, left, right))
    return logical(operator, left, right)


def _unary(scope: Scope, node: Node) -> Code:
    operator = text_of(field(node, "operator"))
    actions: dict[str, Callable[[Value], Value]] = {
        "-": lambda v: -to_number(v),
        "+": to_number,
        "!": lambda v: not to_boolean(v),
        "~": lambda v: float(~to_int32(v)),
        "typeof": type_name,
    }
    if operator not in actions:
        raise scope.refuse(node, f"the operator {operator} is not part of the language of labs")
    argument, action = compile_term(scope, field(node, "argument")), actions[operator]
    return lambda m: action(argument(m))


def _ternary(scope: Scope, node: Node) -> Code:
    condition, yes, no = (compile_term(scope, field(node, f)) for f in ("condition", "consequence", "alternative"))
    return lambda m: yes(m) if to_boolean(condition(m)) else no(m)


def _sequence(scope: Scope, node: Node) -> Code:
    codes = [compile_term(scope, part) for part in parts(node)]

    def run(m: Machine) -> Value:
        value: Value = UNDEFINED
        for code in codes:
            value = code(m)
        return value

    return run


def read_member(value: Value, name: str) -> Value:
    """`value.name` for the few names that values have: `length`, and the parts of a record."""
    if value is None or value is UNDEFINED:
        raise Trouble(f"{to_string(value)} has no {name}")
    return targets.length_of(value) if name == "length" else targets.part_of(value, name)


def _member(scope: Scope, node: Node) -> Code:
    path = paths.path_of(node)
    if path is not None and not (path[-1] == "length" and len(path) > 2):
        return paths.load(scope, node, path)
    name = text_of(field(node, "property"))
    if name not in targets.MEMBERS:
        raise scope.refuse(field(node, "property"), f".{name} is not available")
    inner, optional = compile_term(scope, field(node, "object")), targets.is_optional(node)

    def run(m: Machine) -> Value:
        value = inner(m)
        if optional and (value is None or value is UNDEFINED):
            raise targets.ShortCircuit
        return read_member(value, name)

    return targets.whole_chain(node, located(scope, node, run))


def _subscript(scope: Scope, node: Node) -> Code:
    targets.check_subscript(scope, node)
    inner, index = compile_term(scope, field(node, "object")), compile_term(scope, field(node, "index"))
    optional = targets.is_optional(node)

    def run(m: Machine) -> Value:
        value = inner(m)
        if optional and (value is None or value is UNDEFINED):
            raise targets.ShortCircuit
        return targets.read_index(value, index(m))

    return targets.whole_chain(node, located(scope, node, run))


def _assignment(scope: Scope, node: Node) -> Code:
    target = targets.compile_target(scope, field(node, "left"))
    right = compile_term(scope, field(node, "right"))
    return located(scope, node, lambda m: target.assign(m, right))


def _augmented(scope: Scope, node: Node) -> Code:
    operator = text_of(field(node, "operator"))[:-1]
    target = targets.compile_target(scope, field(node, "left"))
    right = compile_term(scope, field(node, "right"))
    if operator in ("&&", "||", "??"):
        return located(scope, node, lambda m: target.assign_if(m, operator, right))
    if operator not in BINARY:
        raise scope.refuse(node, f"the operator {operator}= is not part of the language of labs")

    def combine(m: Machine, old: Value) -> Value:
        b = right(m)
        m.tick(weight(old) + weight(b))
        return BINARY[operator](old, b)

    return located(scope, node, lambda m: target.update(m, combine)[1])


def _update(scope: Scope, node: Node) -> Code:
    target = targets.compile_target(scope, field(node, "argument"))
    step = 1.0 if text_of(field(node, "operator")) == "++" else -1.0
    after = node.children[0].type not in ("++", "--")

    def run(m: Machine) -> Value:
        old, new = target.update(m, lambda m, old: to_number(old) + step)
        return to_number(old) if after else new

    return located(scope, node, run)


EXPRESSIONS.update(
    {
        "parenthesized_expression": _parentheses,
        "number": lambda s, n: _constant(number_of(s.source, n)),
        "string": lambda s, n: _constant(string_of(s.source, n)),
        "template_string": _template,
        "true": lambda s, n: _constant(True),
        "false": lambda s, n: _constant(False),
        "null": lambda s, n: _constant(None),
        "undefined": lambda s, n: _constant(UNDEFINED),
        "identifier": _identifier,
        "array": _array,
        "binary_expression": _binary,
        "unary_expression": _unary,
        "ternary_expression": _ternary,
        "sequence_expression": _sequence,
        "member_expression": _member,
        "subscript_expression": _subscript,
        "assignment_expression": _assignment,
        "augmented_assignment_expression": _augmented,
        "update_expression": _update,
        "call_expression": calls.compile_call,
        "new_expression": calls.compile_new,
    }
)
