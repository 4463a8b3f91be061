"""ONNX files of policies: what is read from them computes what the reference of ONNX computes; one through the jail."""

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from grader.domain.verdict import Status
from grader.exercises.kinds.policy.judge import REFUSAL_CHARS_MAX
from grader.exercises.kinds.policy.network import Network
from grader.exercises.kinds.policy.onnx import Refused, read_chain
from grader.exercises.kinds.policy.parameters import PolicyForm
from grader.grading.pipeline import Pipeline
from grader.questions.forms import FORMS, read_text
from grader.sandbox.jail import Jail
from support.content import load_content
from support.onnx_files import FLOAT32, JAIL, LINEAR, NODES, B, W, draw, export, join, pack, read, tensor
from support.sites import ROOT

QUIZ = "5.1-exercises"


@pytest.mark.parametrize("dtype", ["f2", "f4", "f8"])
@pytest.mark.parametrize("raw", [True, False])
@pytest.mark.parametrize("gemm", [True, False])
@pytest.mark.parametrize("function", NODES)
def test_exports_of_networks_are_read_to_the_bit(function: str, gemm: bool, raw: bool, dtype: str) -> None:
    layers = draw((4, 5, 3, 2), dtype)
    data = export(layers, [function, function, "tanh"], gemm=gemm, raw=raw)
    form = {"kind": "mlp", "hidden": [5, 3], "activation": function, "output": "tanh"}
    assert np.array_equal(read(data, form), join(layers))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 10**6), st.lists(st.integers(1, 9), min_size=2, max_size=6), st.sampled_from([*NODES]),
    st.sampled_from(["linear", "tanh"]), st.booleans(), st.sampled_from([1, "batch", None]),
    st.booleans(),
)  # fmt: skip
def test_a_network_computes_what_onnx_computes(
    seed: int, widths: list[int], function: Any, output: str, gemm: bool, batch: Any, normalises: bool
) -> None:
    layers = draw(widths, "f8", seed)
    hidden = widths[1:-1]
    rng = np.random.default_rng(seed)
    scales = (rng.normal(size=widths[0]), rng.uniform(0.5, 2, (1, widths[0]))) if normalises else None
    data = export(layers, [function] * len(hidden) + [output], gemm=gemm, batch=batch, normalisation=scales)
    form = {"kind": "mlp" if hidden else "linear", "hidden": hidden, "activation": function, "output": output}
    numbers = read(data, form, widths[0], widths[-1])
    assert np.array_equal(numbers, join([*layers, *([scales] if scales else [])]))
    chain = read_chain(data, widths[0])
    converted = tuple((layer.weights, layer.bias) for layer in chain.layers)
    network = Network(converted, function, output, None, (chain.mean, chain.std) if normalises else None)
    for observed in rng.normal(0, 2, (4, 1, widths[0])):
        (expected,) = ReferenceEvaluator(data).run(None, {"x": observed})
        tolerance = 1e-7 if function == "leaky_relu" else 1e-12  # ONNX keeps the slope as float32
        assert np.allclose(network.act(observed[0]), expected[0], rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize(
    ("nodes", "layer"),
    [
        ([("Gemm", "x W b", {"alpha": 0.5, "beta": 2.0})], (W / 2, B * 2)),
        ([("Gemm", "x W", {})], (W, B * 0)),
        ([("Gemm", "x W one", {})], (W, B * 0 + 3)),
        ([("Gemm", "x W", {}), ("Add", "0 b", {})], (W, B)),
        ([("MatMul", "x W", {}), ("Add", "0 row", {})], (W, B)),
        ([("Transpose", "WT", {"perm": [1, 0]}), ("MatMul", "x 0", {}), ("Add", "b 1", {})], (W, B)),
        ([("Identity", "b", {}), ("Gemm", "x W 0", {})], (W, B)),
        ([("Constant", "", {"value": tensor("", W)}), ("Gemm", "x 0 b", {})], (W, B)),
        ([("Flatten", "x", {"axis": 1}), ("Cast", "0", {"to": FLOAT32}), ("Gemm", "1 W b", {})], (W, B)),
        ([("Reshape", "x shape", {}), ("Gemm", "0 W b", {}), ("Squeeze", "1 zero", {})], (W, B)),
        ([("Gemm", "x W b", {}), ("Identity", "0", {}), ("Squeeze", "1", {}), ("Unsqueeze", "2 zero", {})], (W, B)),
    ],
)  # fmt: skip
def test_what_changes_nothing_is_read(nodes: Sequence[tuple[str, str, dict[str, Any]]], layer: tuple[Any, Any]) -> None:
    known = {
        "W": W, "b": B, "WT": W.T, "one": np.array([3], np.float32), "row": B[None], "zero": np.array([0]),
        "shape": np.array([-1, 4]),
    }  # fmt: skip
    made = [
        helper.make_node(operator, inputs.split(), [str(index)], **attributes)
        for index, (operator, inputs, attributes) in enumerate(nodes)
    ]
    data = pack(made, [tensor(name, array) for name, array in known.items()])
    assert np.array_equal(read(data, LINEAR), join([layer]))
    observed = np.array([[1, -2, 3, 0.5]], np.float32)
    (expected,) = ReferenceEvaluator(data).run(None, {"x": observed})
    assert np.array_equal(np.ravel(expected), (observed @ layer[0] + layer[1])[0])


@pytest.mark.slow
@settings(max_examples=600, deadline=None)
@given(
    st.sampled_from([True, False]),
    st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=2),
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_changed_file_is_refused_or_computes_what_onnx_computes(gemm: bool, places: list[tuple[int, int]]) -> None:
    data = bytearray(export(draw((4, 5, 2), "f4"), ["tanh", "linear"], gemm=gemm))
    for place, byte in places:
        data[place % len(data)] = byte
    try:
        weights = read(bytes(data), {"kind": "mlp", "hidden": [5]})
    except (JAIL["WrongArrays"], JAIL["WrongFile"]) as error:
        assert str(error).isprintable()
        assert len(str(error)) <= REFUSAL_CHARS_MAX
        return
    first, bias, second, last = np.split(weights, [20, 25, 35])
    observed = np.array([[0.3, -0.2, 0.1, 0.7]], np.float32)
    try:
        model = onnx.load_from_string(bytes(data))
        (expected,) = ReferenceEvaluator(model).run(None, {model.graph.input[0].name: observed})
    except Exception:  # ONNX is stricter where its own types disagree, in each of its versions elsewhere
        return
    outputs = np.tanh(observed @ first.reshape(4, 5) + bias) @ second.reshape(5, 2) + last
    assert np.allclose(outputs, expected, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("name", ["Linear", "Linear_no_bias"])
def test_files_of_pytorch_are_read(name: str) -> None:
    """They are test data of ONNX, for four rows of observations."""
    folder = Path(onnx.__file__).parent / "backend/test/data/pytorch-converted" / f"test_{name}"
    model = onnx.load(folder / "model.onnx")
    assert model.producer_name == "pytorch"
    with pytest.raises(Refused, match="declared as 4 x 10"):
        read_chain(model.SerializeToString(), 10)
    model.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 1
    for one in [one for one in model.graph.node[-1].attribute if one.name == "broadcast"]:  # before opset 7
        model.graph.node[-1].attribute.remove(one)
    (layer,) = read_chain(model.SerializeToString(), 10).layers
    observed, expected = [
        numpy_helper.to_array(onnx.load_tensor(folder / "test_data_set_0" / f"{what}_0.pb"))
        for what in ("input", "output")
    ]
    assert np.allclose(observed @ layer.weights + (0 if layer.bias is None else layer.bias), expected, atol=1e-6)


def test_an_answer_may_be_an_onnx_file() -> None:
    answer = {"file": base64.b64encode(export([(W, B)], ["linear"])).decode()}
    assert read_text(FORMS["npz"], answer) == answer["file"]


@pytest.mark.jail
@pytest.mark.slow
def test_an_onnx_file_of_a_right_policy_is_correct() -> None:
    library = load_content(QUIZ)
    paths = sorted((ROOT / "reference_solutions" / QUIZ).glob("*/correct__*.npz"))
    graded = {}
    with Jail(library.root / "models", workers=1) as jail:
        pipeline = Pipeline(library, jail.run)
        for path in paths:
            question: Any = library.question(QUIZ, path.parent.name)
            form = PolicyForm.model_validate(question.check.parameters["form"])
            arrays = np.load(path)
            if path.parent.name in graded:
                continue
            layers = [
                (arrays[name], arrays[f"b{name[1:]}"] if f"b{name[1:]}" in arrays else np.zeros(arrays[name].shape[1]))
                for name in arrays
                if name.startswith("W")
            ]
            scales = (arrays["mean"].astype("f4"), arrays["std"].astype("f4")) if "mean" in arrays else None
            data = export(layers, form.list_functions(), normalisation=scales)
            verdict = pipeline.grade(QUIZ, path.parent.name, {"file": base64.b64encode(data).decode()}, 7)
            graded[path.parent.name] = verdict.status
            refused = pipeline.grade(QUIZ, path.parent.name, {"file": base64.b64encode(data[:-9]).decode()}, 7)
            assert refused.status is Status.CRASHED
            assert "The file is damaged" in (refused.diagnosis or "")
    assert graded == dict.fromkeys(("cart-pole-policy", "drone-policy", "servo-arm-policy"), Status.CORRECT)
