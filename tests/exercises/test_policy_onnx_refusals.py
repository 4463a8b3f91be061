"""ONNX files that are no linear map and no MLP: each is refused with a sentence, and none makes reading slow."""

import time
from typing import Any

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper

from grader.exercises.kinds.policy.judge import REFUSAL_CHARS_MAX
from support.onnx_files import FLOAT32, JAIL, LINEAR, B, W, draw, export, pack, read, tensor


def node(operator: str, inputs: str = "x", **attributes: Any) -> Any:
    return helper.make_node(operator, inputs.split(), ["y"], f"/{operator.lower()}", **attributes)


M = tensor("m", W[:, 0])
GEMM = helper.make_node("Gemm", ["x", "W", "b"], ["g"], "/gemm")


def change(what: str) -> bytes:
    """A linear map with something that no policy has."""
    model = onnx.load_from_string(pack([GEMM], [tensor("W", W), tensor("b", B)]))
    graph = model.graph
    first, second = graph.initializer
    if what == "external":
        first.external_data.add(key="location", value="/etc/passwd")
        first.data_location = TensorProto.EXTERNAL
    elif what == "elsewhere":
        first.data_location = TensorProto.EXTERNAL
    elif what == "functions":
        relu = helper.make_node("Relu", ["a"], ["b"])
        model.functions.append(helper.make_function("", "Gemm", ["a"], ["b"], [relu], model.opset_import))
    elif what == "inputs":
        graph.input.append(helper.make_tensor_value_info("z", FLOAT32, [1, 4]))
    elif what == "outputs":
        graph.output.append(helper.make_tensor_value_info("x", FLOAT32, [1, 4]))
    elif what == "batch":
        graph.input[0].type.tensor_type.shape.dim[0].dim_value = 2
    elif what == "integers":
        graph.input[0].type.tensor_type.elem_type = TensorProto.INT64
    elif what == "sparse":
        graph.sparse_initializer.add()
    elif what == "bfloat16":
        first.data_type = TensorProto.BFLOAT16
    elif what == "domain":
        graph.node[0].domain = "com.microsoft"
    elif what == "nan":
        second.CopyFrom(tensor("b", B * np.nan))
    elif what == "inf":
        second.CopyFrom(tensor("b", (B * np.inf).astype(np.float16)))
    elif what == "few":
        first.dims[0] = 2**62
    elif what == "dims":
        first.dims.extend([2**62] * 100_000)
    elif what == "twice":
        first.float_data.append(1.0)
    data: bytes = model.SerializeToString()
    return data


def with_graph(operator: str) -> bytes:
    inner = helper.make_graph([node("Relu", "g")], "inner", [], [helper.make_tensor_value_info("y", FLOAT32, None)])
    names = {"If": ["then_branch", "else_branch"], "Loop": ["body"], "Scan": ["body"]}[operator]
    return pack(
        [GEMM, helper.make_node(operator, ["g"], ["z"], "/deep", **dict.fromkeys(names, inner))],
        [tensor("W", W), tensor("b", B)],
    )


def after(*nodes: Any, **arrays: Any) -> bytes:
    known = {"W": W, "b": B, "M": np.eye(2, dtype=np.float32), "whole": np.array([[1, 2]] * 4)}
    return pack([GEMM, *nodes], [tensor(name, array) for name, array in (known | arrays).items()])


REFUSED: dict[str, tuple[bytes, str]] = {
    **{name: (after(node(name, "g")), f"('{name}') is no part") for name in ("Softmax", "Clip", "Gelu", "Exp")},
    **{name: (with_graph(name), f"'/deep' ('{name}') is no part") for name in ("If", "Loop", "Scan")},
    "another function": (after(node("Tanh", "g")), "ends with tanh, and that of this policy with linear"),
    "function first": (pack([node("Relu")]), "'/relu' ('Relu') is no part of a linear map or an MLP where it stands"),
    "skip connection": (after(node("Add", "g x")), "the graph branches"),
    "twice": (after(node("Add", "g g")), "the graph branches"),
    "scaled": (after(node("Mul", "g b")), "'/mul' ('Mul') is no part"),
    "no bias": (after(node("Add", "g")), "('Add') is no part"),
    "mean minus x": (pack([node("Sub", "m x")], [M]), "has a constant on its left"),
    "mean after a layer": (after(node("Sub", "g b")), "('Sub') is no part"),
    "std of 0": (export([(W, B)], ["linear"], normalisation=(W[:, 0], W[:, 0])), "std holds a number"),
    "two means": (pack([node("Sub", "x m"), helper.make_node("Sub", ["y", "m"], ["z"])], [M]), "('Sub') is no part"),
    "two biases": (after(node("Add", "g b")), "('Add') is no part"),
    "bias of another shape": (after(node("Gemm", "g M W")), "has an array of the shape (4, 2)"),
    "column": (after(helper.make_node("Reshape", ["g", "s"], ["h"]), node("Add", "h b"), s=np.array([2, 1])), "'/add'"),
    "weights on the left": (after(node("MatMul", "M g")), "has a constant on its left"),
    "transA": (after(node("Gemm", "g M", transA=1)), "or transA"),
    "integer weights": (pack([node("MatMul", "x W")], [tensor("W", np.ones((4, 2), int))]), "weights of the shape"),
    "wrong rows": (pack([node("MatMul", "x W")], [tensor("W", np.ones((3, 2)))]), "the shape (3, 2), or transA, for 4"),
    "wrong columns": (pack([node("MatMul", "x W")], [tensor("W", np.ones((4, 3)))]), "sizes (4, 3) instead of (4, 2)"),
    "too deep": (after(node("Gemm", "g M")), "the sizes (4, 2, 2) instead of (4, 2)"),
    "slope": (after(node("LeakyRelu", "g", alpha=0.2)), "has the alpha 0.2, and policies have 0.01"),
    "slope nan": (after(node("Elu", "g", alpha=float("nan"))), "has the alpha nan"),
    "to integers": (after(node("Cast", "g", to=TensorProto.INT32)), "'/cast' ('Cast')"),
    "of data": (after(node("Transpose", "g")), "'/transpose' ('Transpose')"),
    "computed weights": (after(node("Add", "M M"), helper.make_node("MatMul", ["g", "y"], ["z"])), "computes weights"),
    "attribute": (after(node("Tanh", "g", broadcast=1)), "has an attribute 'broadcast'"),
    "output": (pack([GEMM], [tensor("W", W), tensor("b", B)], ends="x"), "The output 'x' is not what"),
    "too many nodes": (after(*[node("Identity", "g")] * 70), "The graph has 71 nodes"),
    "width": (pack([GEMM], width=7), "The input is declared as ? x 7"),
    "external": (change("external"), "external data"),
    "elsewhere": (change("elsewhere"), "has them elsewhere"),
    "functions": (change("functions"), "The ONNX file holds functions"),
    "inputs": (change("inputs"), "2 inputs and 1 outputs"),
    "outputs": (change("outputs"), "1 inputs and 2 outputs"),
    "batch": (change("batch"), "The input is declared as 2 x 4"),
    "integers": (change("integers"), "or not of floats"),
    "sparse": (change("sparse"), "holds sparse numbers"),
    "bfloat16": (change("bfloat16"), "'W' holds numbers of ONNX's type 16"),
    "domain": (change("domain"), "'/gemm' ('Gemm') is no part"),
    "nan": (change("nan"), "b1 holds nan"),
    "inf": (change("inf"), "b1 holds inf: float16 ends at 65504"),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_policy_is_refused_with_the_cure(name: str) -> None:
    data, sentence = REFUSED[name]
    with pytest.raises(JAIL["WrongArrays"]) as refused:
        read(data, LINEAR)
    said = str(refused.value)
    assert sentence in said, said
    assert said.isprintable()
    assert len(said) <= REFUSAL_CHARS_MAX
    assert "numpy.savez(" in said or "ayer" in said or "holds" in said


def test_a_bias_needs_a_declared_one() -> None:
    form = {"kind": "linear", "bias": False}
    with pytest.raises(JAIL["WrongArrays"], match="Layer 1 of the ONNX file has a bias, and this policy has none"):
        read(after(), form)
    assert np.array_equal(read(after(b=B * 0), form), W.ravel())


@pytest.mark.parametrize("what", ["few", "dims", "twice"])
def test_a_tensor_that_lies_is_damaged(what: str) -> None:
    with pytest.raises(JAIL["WrongFile"], match="The file is damaged"):
        read(change(what), LINEAR)


def read_anything(data: bytes) -> None:
    """Reads a file that may be refused, and nothing else."""
    try:
        read(data, {"kind": "mlp", "hidden": [5], "output": "tanh"})
    except (JAIL["WrongArrays"], JAIL["WrongFile"]) as error:
        assert str(error).isprintable()
        assert len(str(error)) <= REFUSAL_CHARS_MAX


RIGHT = export(draw((4, 5, 2), "f4"), ["tanh", "tanh"])


def test_every_beginning_of_a_file_is_damaged() -> None:
    for end in range(1, len(RIGHT)):
        with pytest.raises((JAIL["WrongFile"], JAIL["WrongArrays"])):
            read(RIGHT[:end], {"kind": "mlp", "hidden": [5], "output": "tanh"})


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=400))
def test_no_bytes_raise_anything_else(data: bytes) -> None:
    read_anything(b"\x08" + data)


def list_long() -> dict[str, bytes]:
    """Files of the largest size with as much to read as they can have."""
    size, versions = 256 * 1024 - 100, b"\x42\x00"

    def wrap(number: int, data: bytes) -> bytes:
        length, rest = b"", len(data)
        while rest > 127:
            length, rest = length + bytes([rest & 127 | 128]), rest >> 7
        return bytes([number << 3 | 2]) + length + bytes([rest]) + data

    graph = {
        "nodes": b"\x0a\x00", "tensors": b"\x2a\x00", "inputs": b"\x5a\x00",
        "named tensors": wrap(5, b"\x10\x01\x42\x00"),
        "scalars": wrap(5, b"\x10\x01\x42\x01x" + wrap(9, b"four")), "deep nodes": wrap(1, wrap(5, b"")),
    }  # fmt: skip
    made = {name: wrap(7, part * (size // len(part))) for name, part in graph.items()}
    made["fields"] = b"\x08\x07" * (size // 2)
    made["graphs"] = b"\x3a\x00" * (size // 2)
    made["sizes"] = wrap(7, wrap(5, b"\x08\x01" * (size // 2)))
    made["numbers"] = wrap(7, wrap(5, b"\x10\x0a" + b"\x28\x01" * (size // 2)))
    made["inputs of a node"] = wrap(7, wrap(1, wrap(4, b"Add") + b"\x0a\x01x" * (size // 3)))
    made["varint"] = b"\x08" + b"\xff" * size
    return {name: data + versions for name, data in made.items()}


@pytest.mark.cost
@pytest.mark.parametrize("name", list_long())
def test_a_long_file_is_read_in_time_that_grows_with_its_size(name: str) -> None:
    before = time.process_time()
    read_anything(list_long()[name])
    assert time.process_time() - before < 1.5
