"""Reads the layers of an ONNX file whose graph is a linear map or an MLP. This is the first part of the driver's
text: it runs in the jail, under the limits of the job, with NumPy and the standard library alone.

No graph is run, and no file is opened beside the bytes that were handed in. Protobuf has four kinds of fields, and a
plain network few messages: they are read here, so that no parser in C gets a stranger's bytes, nothing needs to be
installed, and every server takes ONNX. What is not named here is refused. Sources: onnx.proto of ONNX 1.23, and
https://protobuf.dev/programming-guides/encoding."""

from collections.abc import Iterator, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

Schema = Mapping[int, str]
"""The name of each field by its number: "" for what is skipped, with a ! for what no plain network has."""
Message = Mapping[str, Sequence[Any]]
"""The values of each field: those of INTEGERS are int, others memoryview."""

MODEL: Schema = {
    7: "graph",
    8: "versions",
    **dict.fromkeys((*range(1, 7), 14), ""),
    20: "!a training",
    25: "!functions",
}
GRAPH: Schema = {
    1: "nodes", 5: "tensors", 11: "inputs", 12: "outputs", **dict.fromkeys((2, 10, 13, 16), ""),
    14: "!quantised numbers", 15: "!sparse numbers",
}  # fmt: skip
NODE: Schema = {
    1: "inputs", 2: "outputs", 3: "name", 4: "operator", 5: "attributes", 7: "domain", 8: "overload", 6: "", 9: "",
}  # fmt: skip
ATTRIBUTE: Schema = {
    1: "name", 2: "float", 3: "int", 5: "tensor", 8: "ints", 20: "type", 13: "", 4: "", 7: "", 9: "",
    6: "!a subgraph", 11: "!subgraphs",
}  # fmt: skip
TENSOR: Schema = {
    1: "sizes", 2: "type", 4: "floats", 5: "int32s", 7: "int64s", 8: "name", 9: "raw", 10: "doubles", 14: "location",
    12: "", 16: "", 13: "!external data: export it with external_data=False",
}  # fmt: skip
VALUE: Schema = {1: "name", 2: "declared", 3: "", 4: ""}
DECLARED, DECLARED_TENSOR, SHAPE = {1: "tensor", 6: ""}, {1: "type", 2: "shape"}, {1: "dimensions"}
SIZE: Schema = {1: "size", 2: "", 3: ""}
INTEGERS = {"int", "ints", "type", "sizes", "int32s", "int64s", "location", "size"}

NODES_MAX, SIZES_MAX = 64, 8
NUMBERS = {1: ("<f4", "floats"), 7: ("<i8", "int64s"), 10: ("<f2", "int32s"), 11: ("<f8", "doubles")}
"""NumPy's type for each of ONNX's that is read, and the field of such numbers where they are not raw."""
FLOATS = (1, 10, 11)
FLOAT, INT, ARRAY, INTS = 1, 2, 4, 7
TYPES = {
    **dict.fromkeys(("alpha", "beta"), FLOAT), "value": ARRAY, **dict.fromkeys(("perm", "axes"), INTS),
    **dict.fromkeys(("transA", "transB", "to", "axis", "allowzero"), INT),
}  # fmt: skip
"""ONNX's type of each attribute that is read."""

FUNCTIONS = {
    "Tanh": "tanh", "Relu": "relu", "LeakyRelu": "leaky_relu", "Elu": "elu", "Swish": "silu", "Softplus": "softplus",
    "Sigmoid": "sigmoid",
}  # fmt: skip
ALPHAS = {"LeakyRelu": 0.01, "Elu": 1.0, "Swish": 1.0}
SAME = ("Identity", "Flatten", "Reshape", "Squeeze", "Unsqueeze", "Cast")
"""They keep the order of numbers: one row of n either stays one, or does not fit into the layer that follows."""
OPERATORS = {*FUNCTIONS, *SAME, "Sub", "Div", "MatMul", "Gemm", "Add", "Mul", "Constant", "Transpose"}


class Refused(Exception):
    """The graph is neither a linear map nor an MLP."""


class Layer:
    """Weights (n, m), a bias (m,) or None, and the functions that follow."""

    def __init__(self, weights: Any, bias: Any) -> None:
        self.weights, self.bias = weights, bias
        self.functions: list[str] = []


class Chain:
    """What the nodes so far compute: `layers`, behind (x - mean) / std where these are arrays (n,). `flow` names the
    newest value, of `width` numbers, and `before` the one that its `operator` took up."""

    def __init__(self, flow: str, width: int, constants: dict[str, Any]) -> None:
        self.flow, self.width, self.constants = flow, width, constants
        self.before = self.operator = ""
        self.mean: Any = None
        self.std: Any = None
        self.layers: list[Layer] = []


def read_chain(data: bytes, width: int) -> Chain:
    """Returns a network of `width` observations. Raises Refused, and ValueError for a damaged file."""
    model = read_message(memoryview(data), MODEL)
    if not {"graph", "versions"} <= {*model}:
        raise ValueError("it has no graph, or ends early")
    graph = read_message(get(model, "graph"), GRAPH)
    nodes = graph.get("nodes", ())
    if len(nodes) > NODES_MAX:
        raise Refused(f"The graph has {len(nodes)} nodes, and at most {NODES_MAX} are read")
    constants = dict(map(read_tensor, graph.get("tensors", ())))
    values = [read_message(value, VALUE) for value in graph.get("inputs", ())]
    inputs = [value for value in values if get_text(value, "name") not in constants]  # old files list weights too
    outputs = [get_text(read_message(value, VALUE), "name") for value in graph.get("outputs", ())]
    if len(inputs) != 1 or len(outputs) != 1:
        raise Refused(f"The graph has {len(inputs)} inputs and {len(outputs)} outputs, and a policy has one each")
    check_input(inputs[0], width)
    chain = Chain(get_text(inputs[0], "name"), width, constants)
    for node in nodes:
        follow(read_message(node, NODE), chain)
    if outputs != [chain.flow]:
        raise Refused(f"The output {outputs[0]!a:.40} is not what the last node computes")
    return chain


def check_input(value: Message, width: int) -> None:
    """Raises Refused for an input that is no row of floats."""
    tensor = read_message(get(read_message(get(value, "declared"), DECLARED), "tensor"), DECLARED_TENSOR)
    shape = read_message(get(tensor, "shape"), SHAPE).get("dimensions", ())
    sizes = [get(read_message(size, SIZE), "size", 0) for size in shape]  # 0 is a name, such as batch
    if get(tensor, "type", 0) not in FLOATS or sizes[-1:] not in ([0], [width]) or {*sizes[:-1]} - {0, 1}:
        shown = " x ".join(str(size or "?") for size in sizes)[:40] or "no row"
        raise Refused(f"The input is declared as {shown}, or not of floats: it must be 1 x {width} floats")


def follow(node: Message, chain: Chain) -> None:
    """Adds a node to the chain or to the constants. Raises Refused, and ValueError."""
    operator, inputs = get_text(node, "operator"), get_texts(node, "inputs")
    output, *further = get_texts(node, "outputs") or [""]
    label = f"The node {get_text(node, 'name') or output!a:.40} ({operator!a:.30})"
    if operator not in OPERATORS or get_text(node, "domain") not in ("", "ai.onnx") or get_text(node, "overload"):
        raise Refused(f"{label} is no part of a linear map or an MLP")
    if output in ("", chain.flow, *chain.constants) or further:
        raise ValueError("a node has no output, or one that is there already")
    attributes = dict(read_attribute(attribute, label) for attribute in node.get("attributes", ()))
    arrays = [chain.constants[name] for name in inputs if name in chain.constants]
    if len(arrays) == len(inputs):
        chain.constants[output] = compute_constant(operator, arrays, attributes, label)
        return
    others = [name for name in inputs if name != chain.flow]
    gated = operator == "Mul" and chain.operator == "Sigmoid" and others == [chain.before]  # x * sigmoid(x)
    if len(inputs) != len(others) + 1 or len(arrays) + gated != len(others):
        raise Refused(f"{label} takes up another value than that of the node before it: the graph branches")
    if operator in ("MatMul", "Gemm", "Sub", "Div") and inputs[0] != chain.flow:
        raise Refused(f"{label} has a constant on its left, and policies compute (x - mean) / std and x @ W")
    if gated:
        chain.layers[-1].functions[-1] = "silu"
    else:
        take_up(operator, arrays, attributes, chain, label)
    chain.before, chain.flow, chain.operator = chain.flow, output, operator


def compute_constant(operator: str, arrays: Sequence[Any], attributes: Mapping[str, Any], label: str) -> Any:
    """Returns the array of a node that depends on no observation. Raises Refused."""
    if operator == "Constant" and "value" in attributes:
        return attributes["value"]
    if operator == "Identity" and arrays:
        return arrays[0]
    if operator == "Transpose" and arrays and arrays[0].ndim == 2 and attributes.get("perm", [1, 0]) == [1, 0]:
        return arrays[0].T
    raise Refused(f"{label} computes weights: export them as they are")


def take_up(operator: str, arrays: Sequence[Any], attributes: Mapping[str, Any], chain: Chain, label: str) -> None:
    """Adds to the layers what a node does. Raises Refused."""
    layer = chain.layers[-1] if chain.layers else None
    if operator in ("MatMul", "Gemm") and arrays:
        weights = arrays[0].T if attributes.get("transB") else arrays[0]
        if weights.dtype.kind != "f" or weights.ndim != 2 or len(weights) != chain.width or attributes.get("transA"):
            raise Refused(f"{label} has weights of the shape {weights.shape}, or transA, for {chain.width} numbers")
        chain.width = weights.shape[1]
        bias = scale(read_bias(arrays[1], chain.width, label), attributes.get("beta", 1.0)) if arrays[1:] else None
        chain.layers.append(Layer(scale(weights, attributes.get("alpha", 1.0)), bias))
    elif operator == "Add" and arrays and layer and layer.bias is None and chain.operator in ("MatMul", "Gemm"):
        layer.bias = read_bias(arrays[0], chain.width, label)
    elif operator == "Sub" and arrays and chain.operator == "":
        chain.mean = read_bias(arrays[0], chain.width, label)
    elif operator == "Div" and arrays and chain.operator in ("", "Sub"):
        chain.std = read_bias(arrays[0], chain.width, label)
    elif operator in FUNCTIONS and layer:
        alpha = ALPHAS.get(operator, 0.0)
        if not abs(attributes.get("alpha", alpha) - alpha) < 1e-6:
            raise Refused(f"{label} has the alpha {attributes['alpha']:g}, and policies have {alpha:g}")
        layer.functions.append(FUNCTIONS[operator])
    elif operator not in SAME or attributes.get("to", FLOATS[0]) not in FLOATS:
        raise Refused(f"{label} is no part of a linear map or an MLP where it stands")


def scale(array: Any, factor: float) -> Any:
    """Returns an array times alpha or beta."""
    with np.errstate(all="ignore"):
        return array if factor == 1 else array.astype(np.float64) * factor


def read_bias(array: Any, width: int, label: str) -> Any:
    """Returns a bias, mean or std (width,). Raises Refused."""
    if array.dtype.kind != "f" or array.shape not in ((), (1,), (1, 1), (width,), (1, width)):
        raise Refused(f"{label} has an array of the shape {array.shape} for {width} numbers")
    return np.broadcast_to(array.ravel(), width)


def read_tensor(data: memoryview) -> tuple[str, Any]:
    """Returns name and numbers of a tensor. Raises Refused, and ValueError."""
    tensor = read_message(data, TENSOR)
    name, kind, sizes = get_text(tensor, "name"), get(tensor, "type", 0), tensor.get("sizes", ())
    if kind not in NUMBERS or get(tensor, "location", 0) != 0:
        raise Refused(f"{name!a:.40} holds numbers of ONNX's type {kind} instead of float32, or has them elsewhere")
    dtype, field = NUMBERS[kind]
    present = {"raw", "floats", "doubles", "int32s", "int64s"} & {*tensor}
    if present == {"raw"}:
        array = np.frombuffer(get(tensor, "raw"), dtype)
    elif present != {field}:
        raise ValueError("a tensor has no numbers, or twice")
    elif field in INTEGERS:
        array = np.array(tensor[field], np.int64).astype("<u2" if kind == 10 else "<i8").view(dtype)
    else:
        array = np.frombuffer(b"".join(tensor[field]), dtype)
    if len(sizes) > SIZES_MAX or min(sizes, default=1) < 1 or prod(sizes) != array.size:
        raise ValueError("a tensor has fewer or more numbers than its sizes say")
    return name, array.reshape(tuple(sizes))


def read_attribute(data: memoryview, label: str) -> tuple[str, Any]:
    """Returns name and value of an attribute. Raises Refused, and ValueError."""
    attribute = read_message(data, ATTRIBUTE)
    name, kind = get_text(attribute, "name"), get(attribute, "type", 0)
    if kind != TYPES.get(name):
        raise Refused(f"{label} has an attribute {name!a:.30}, which is not read")
    if kind == ARRAY:
        return name, read_tensor(get(attribute, "tensor"))[1]
    if kind == FLOAT:
        return name, np.frombuffer(get(attribute, "float"), "<f4").item()
    return name, list(attribute.get("ints", ())) if kind == INTS else get(attribute, "int", 0)


def get(message: Message, name: str, default: Any = b"") -> Any:
    """Returns the value of a field that a message has at most once. Raises ValueError."""
    value, *further = message.get(name, [default])
    if further:
        raise ValueError(f"it has its {name} twice")
    return value


def get_texts(message: Message, name: str) -> list[str]:
    """Returns the texts of a field but for empty ones. Raises ValueError."""
    return [str(value, "utf-8") for value in message.get(name, ()) if len(value)]


def get_text(message: Message, name: str) -> str:
    """Returns the text of a field. Raises ValueError."""
    return str(get(message, name), "utf-8")


def read_message(data: memoryview, schema: Schema) -> Message:
    """Returns the values of each field of a message. Raises Refused, and ValueError."""
    message: dict[str, list[Any]] = {}
    for number, value in list_fields(data):
        name = schema.get(number, "?")
        if name.startswith("!"):
            raise Refused(f"The ONNX file holds {name[1:]}")
        is_integer = isinstance(value, int)
        if name == "?" or (is_integer and name and name not in INTEGERS):
            raise ValueError(f"an unknown field {number}")
        packed = name in INTEGERS and not is_integer
        message.setdefault(name, []).extend(list_varints(value) if packed else [value])
    return message


def list_fields(data: memoryview) -> Iterator[tuple[int, Any]]:
    """Yields number and value of each field: int, or the bytes of anything else. Raises ValueError."""
    at = 0
    while at < len(data):
        key, at = read_varint(data, at)
        value, at = read_varint(data, at) if key & 7 in (0, 2) else ({1: 8, 5: 4}.get(key & 7, -1), at)
        if key & 7 == 0:
            yield key >> 3, value
            continue
        if not 0 <= value <= len(data) - at:
            raise ValueError("it ends within a field")
        yield key >> 3, data[at : at + value]
        at += value


def list_varints(data: memoryview) -> Iterator[int]:
    """Yields integers that follow each other. Raises ValueError."""
    at = 0
    while at < len(data):
        value, at = read_varint(data, at)
        yield value


def read_varint(data: memoryview, at: int) -> tuple[int, int]:
    """Returns an integer of 64 bits with its sign, and where it ends. Raises ValueError."""
    value = 0
    for index, byte in enumerate(data[at : at + 10]):
        value |= (byte & 127) << 7 * index
        if byte < 128:
            return (value & (1 << 63) - 1) - (value & 1 << 63), at + index + 1
    raise ValueError("it ends within a number")
