"""Calls: functions of the host by name, methods of values, and arrow functions."""

from collections.abc import Callable

import mujoco
from tree_sitter import Node

from grader.labs import paths, targets
from grader.labs.blocks import compile_body
from grader.labs.dispatch import compile_term, located
from grader.labs.functions import FUNCTIONS, TYPED_ARRAYS, Function
from grader.labs.machine import Machine
from grader.labs.methods import CALLBACK_METHODS, NAMES, call_method
from grader.labs.scope import Code, Maker, Scope
from grader.labs.syntax import field, parts, text_of
from grader.labs.values import UNDEFINED, Trouble, Value, Vector, weight

Arguments = Callable[[Machine], list[Value]]


def host_function(node: Node) -> Function | None:
    """The host's function that a name stands for, if it is one."""
    if node.type == "identifier":
        return FUNCTIONS.get((text_of(node),))
    if node.type != "member_expression":
        return None
    names = text_of(field(node, "object")), text_of(field(node, "property"))
    return FUNCTIONS.get(names) if field(node, "object").type == "identifier" else None


def is_function(scope: Scope, node: Node) -> bool:
    """Whether a name stands for a function, which can be called but is no value."""
    if host_function(node) is not None or text_of(node) in ("Array", *TYPED_ARRAYS):
        return True
    return node.type == "identifier" and text_of(node) != "value" and scope.find(node).kind == "function"


def compile_items(scope: Scope, nodes: list[Node]) -> Arguments:
    """Code that gives the values of a list, with `...array` spread out."""
    codes = [
        (compile_term(scope, parts(n)[0] if n.type == "spread_element" else n), n.type == "spread_element")
        for n in nodes
    ]
    if not any(spread for _, spread in codes):
        plain = [code for code, _ in codes]
        return lambda m: [code(m) for code in plain]

    def run(m: Machine) -> list[Value]:
        items: list[Value] = []
        for code, spread in codes:
            value = code(m)
            items.extend(_spread(m, value) if spread else [value])
        return items

    return run


def _spread(m: Machine, value: Value) -> list[Value]:
    m.tick(1 + weight(value))
    if isinstance(value, Vector):
        return value.values()
    if isinstance(value, list):
        return value
    raise Trouble("only an array can be spread out")


def compile_call(scope: Scope, node: Node) -> Code:
    """Code of a call expression."""
    function, arguments = field(node, "function"), field(node, "arguments")
    if arguments.type != "arguments":
        raise scope.refuse(node, "tagged templates are not part of the language of labs")
    args = parts(arguments)
    host = host_function(function)
    if host is not None and not targets.is_optional(node):
        return located(scope, node, _host_call(scope, node, host, args))
    if function.type == "identifier":
        return _named_call(scope, node, args)
    if function.type != "member_expression":
        raise scope.refuse(node, "only functions that have a name can be called")
    return targets.whole_chain(node, located(scope, node, _method_call(scope, node, args)))


def _host_call(scope: Scope, node: Node, host: Function, args: list[Node]) -> Code:
    name = text_of(field(node, "function"))
    written = tuple(text_of(arg) for arg in args[: len(host.takes)])
    if written != host.takes:
        raise scope.refuse(node, f"{name} begins with {', '.join(host.takes)}")
    if name == "Array.from" and len(args) == 2:
        return _array_from(scope, host, args)
    items, call, cost = compile_items(scope, args[len(host.takes) :]), host.call, host.cost

    def run(m: Machine) -> Value:
        values = items(m)
        m.tick(cost + sum(map(weight, values)))
        try:
            return call(m, *values)
        except mujoco.FatalError as error:
            raise Trouble(f"MuJoCo: {error}") from error

    return run


def _array_from(scope: Scope, host: Function, args: list[Node]) -> Code:
    items, maker = compile_items(scope, args[:1]), compile_function(scope, args[1])

    def run(m: Machine) -> Value:
        function, copied = maker(m), host.call(m, *items(m))
        assert isinstance(copied, list)
        return [function(x, float(i)) for i, x in enumerate(copied)]

    return run


def _named_call(scope: Scope, node: Node, args: list[Node]) -> Code:
    function = field(node, "function")
    if text_of(function) in TYPED_ARRAYS or text_of(function) == "Array":
        raise scope.refuse(node, f"write new {text_of(function)}(...)")
    maker = scope.find(function).maker if text_of(function) not in paths.ROOTS | {"value", "undefined"} else None
    if maker is None:
        raise scope.refuse(function, f"{text_of(function)} is no function")
    items = compile_items(scope, args)
    return located(scope, node, lambda m: maker(m)(*items(m)))


def _method_call(scope: Scope, node: Node, args: list[Node]) -> Code:
    function = field(node, "function")
    name, receiver = text_of(field(function, "property")), field(function, "object")
    if name not in NAMES or (paths.path_of(receiver) or ("", ""))[1:] == ():
        raise scope.refuse(function, f"{text_of(function)[:60]}() is not available")
    path = paths.path_of(receiver)
    if path is not None and name in ("set", "fill", "sort", "reverse") and paths.vector_is_writable(path) is False:
        raise scope.refuse(node, f"{'.'.join(path)} can only be read")
    this, optional = compile_term(scope, receiver), targets.is_optional(function)
    maker = compile_function(scope, args[0]) if name in CALLBACK_METHODS and args else None
    if name in CALLBACK_METHODS - {"sort"} and maker is None:
        raise scope.refuse(node, f"{name} needs a function")
    items = compile_items(scope, args[1:] if maker else args)

    def run(m: Machine) -> Value:
        value = this(m)
        if optional and (value is None or value is UNDEFINED):
            raise targets.ShortCircuit
        first = [maker(m)] if maker else []
        return call_method(m, value, name, [*first, *items(m)])

    return run


def compile_function(scope: Scope, node: Node) -> Maker:
    """The function that an argument is: an arrow function, or the name of a function. Raises Refused for others."""
    if node.type == "arrow_function":
        return compile_arrow(scope, node)
    host = host_function(node)
    if host is not None and not host.takes:
        call = host.call
        return lambda m: lambda *args: call(m, *args)
    if node.type == "identifier" and text_of(node) not in paths.ROOTS | {"value", "undefined"}:
        maker = scope.find(node).maker
        if maker is not None:
            return maker
    raise scope.refuse(node, "a function is needed here, such as x => 2 * x")


def compile_arrow(scope: Scope, node: Node) -> Maker:
    """An arrow function of plain parameters."""
    single = node.child_by_field_name("parameter")
    names = [single] if single is not None else parts(field(node, "parameters"))
    inside = scope.inner(in_loop=False, in_function=True)
    if any(name.type != "identifier" for name in names) or any(c.type == "async" for c in node.children):
        raise scope.refuse(node, "a function here has plain parameters only")
    slots = [inside.declare(name, "parameter", ready=True).slot for name in names]
    body = field(node, "body")
    code = compile_body(inside, body) if body.type == "statement_block" else compile_term(inside, body)

    def make(m: Machine) -> Callable[..., Value]:
        def call(*args: Value) -> Value:
            m.tick()
            for i, slot in enumerate(slots):
                m.slots[slot] = args[i] if i < len(args) else UNDEFINED
            return code(m)

        return call

    return make


def compile_new(scope: Scope, node: Node) -> Code:
    """`new Array(n).fill(x)` and `new Float64Array(n)`; nothing else is constructed."""
    constructor = text_of(field(node, "constructor"))
    arguments = node.child_by_field_name("arguments")
    args = parts(arguments) if arguments is not None else []
    typed = TYPED_ARRAYS.get(constructor)
    if typed is not None:
        return located(scope, node, _host_call_plain(scope, typed, args))
    filled = node.parent is not None and node.parent.type == "member_expression"
    filled = filled and text_of(field(node.parent, "property")) == "fill" if node.parent is not None else False
    if constructor == "Array" and len(args) == 1 and args[0].type != "spread_element" and filled:
        size = compile_term(scope, args[0])
        return located(scope, node, lambda m: _empty(m, size(m)))
    raise scope.refuse(node, "only new Array(n).fill(x) and new Float64Array(n) are available")


def _host_call_plain(scope: Scope, function: Function, args: list[Node]) -> Code:
    items = compile_items(scope, args)
    return lambda m: function.call(m, *items(m))


def _empty(m: Machine, size: Value) -> Value:
    if not isinstance(size, float) or not size.is_integer() or not 0 <= size <= 10_000:
        raise Trouble("an array here has from 0 to 10000 elements")
    m.tick(1 + int(size) // 16)
    return [UNDEFINED] * int(size)
