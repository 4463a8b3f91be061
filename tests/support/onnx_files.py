"""ONNX files of networks, and what the driver of policies reads from them."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from onnx import TensorProto, helper, numpy_helper

from grader.exercises.kinds.policy import Policy
from grader.exercises.kinds.policy.parameters import PolicyForm

NODES = {
    "tanh": "Tanh", "silu": "Swish",
    "relu": "Relu", "leaky_relu": "LeakyRelu", "elu": "Elu", "softplus": "Softplus", "sigmoid": "Sigmoid",
}  # fmt: skip
FLOAT32 = TensorProto.FLOAT

JAIL: dict[str, Any] = {"__name__": "kind"}
exec(Policy.driver, JAIL)
"""The names of the driver as the jail has them."""


def tensor(name: str, array: Any, *, raw: bool = True) -> Any:
    """A tensor with its numbers as bytes, or each in a field."""
    if raw:
        return numpy_helper.from_array(np.ascontiguousarray(array), name)
    kind = helper.np_dtype_to_tensor_dtype(array.dtype)
    return helper.make_tensor(name, kind, array.shape, array.ravel())


def pack(
    nodes: Sequence[Any], constants: Sequence[Any] = (), width: int = 4, *, kind: int = FLOAT32,
    batch: Sequence[Any] = ("batch",), ends: str | None = None,
) -> bytes:  # fmt: skip
    """An ONNX file of nodes from `x` to the output of the last."""
    output = helper.make_tensor_value_info(ends or nodes[-1].output[0], kind, None)
    input_ = helper.make_tensor_value_info("x", kind, [*batch, width])
    graph = helper.make_graph(nodes, "main_graph", [input_], [output], constants)
    data: bytes = helper.make_model(graph, producer_name="tests").SerializeToString()
    return data


def export(
    layers: Sequence[tuple[Any, Any]], functions: Sequence[str], *, gemm: bool = True, raw: bool = True, batch: Any = 1,
    normalisation: tuple[Any, Any] | None = None,
) -> bytes:  # fmt: skip
    """An ONNX file of layers (W, b) as PyTorch writes it: Gemm with transB, or MatMul and Add with the bias first.
    Where mean and std are given, it begins with Sub and Div."""
    nodes: list[Any] = []
    constants: list[Any] = []
    flow = "x"
    if normalisation is not None:
        constants += map(tensor, ("mean", "std"), normalisation)
        nodes = [helper.make_node("Sub", ["x", "mean"], ["d"]), helper.make_node("Div", ["d", "std"], ["z"])]
        flow = "z"
    for index, ((weights, bias), function) in enumerate(zip(layers, functions, strict=True)):
        constants += (
            tensor(f"net.{index}.weight", weights.T if gemm else weights, raw=raw),
            tensor(f"net.{index}.bias", bias, raw=raw),
        )
        names = [f"net.{index}.weight", f"net.{index}.bias"]
        if gemm:
            nodes.append(
                helper.make_node("Gemm", [flow, *names], [f"y{index}"], f"/net/{index}/Gemm", transB=1, alpha=1.0)
            )
        else:
            nodes.append(helper.make_node("MatMul", [flow, names[0]], [f"m{index}"], f"/net/{index}/MatMul"))
            nodes.append(helper.make_node("Add", [names[1], f"m{index}"], [f"y{index}"], f"/net/{index}/Add"))
        flow = f"y{index}"
        if function == "silu" and not gemm:
            nodes.append(helper.make_node("Sigmoid", [flow], [f"s{index}"]))
            nodes.append(helper.make_node("Mul", [flow, f"s{index}"], [f"a{index}"]))
        elif function != "linear":
            nodes.append(helper.make_node(NODES[function], [flow], [f"a{index}"], f"/net/{index}/{function}"))
        flow = nodes[-1].output[0]
    kind = helper.np_dtype_to_tensor_dtype(layers[0][0].dtype)
    return pack(nodes, constants, len(layers[0][0]), kind=kind, batch=[batch])


def read(data: bytes, form: Mapping[str, Any], width: int = 4, controls: int = 2) -> Any:
    """The numbers that the driver submits for a file."""
    declared = PolicyForm.model_validate(form)
    inputs = {"width": width, "functions": declared.list_functions(), "observed": []}
    return JAIL["read_file"](data, declared.list_shapes(width, controls), inputs)


def draw(widths: Sequence[int], dtype: str, seed: int = 0) -> list[tuple[Any, Any]]:
    rng = np.random.default_rng(seed)
    return [
        (rng.normal(0, 0.7, (n, m)).astype(dtype), rng.normal(0, 0.3, m).astype(dtype)) for n, m in pairwise(widths)
    ]


def join(layers: Sequence[tuple[Any, Any]]) -> Any:
    return np.concatenate([array.astype(float).ravel() for layer in layers for array in layer])


W, B = (np.arange(8, dtype=np.float32).reshape(4, 2) / 8, np.array([1, 2], np.float32))
LINEAR = {"kind": "linear"}
