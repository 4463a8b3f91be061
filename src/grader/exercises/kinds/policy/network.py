"""Runs a policy: the numbers of a file in the declared form."""

import base64
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import accumulate
from math import prod
from typing import Any

import mujoco
import numpy as np

from grader.exercises.episodes.simulating import Floats
from grader.exercises.judgement import Results
from grader.exercises.kinds.policy.parameters import Activation, PolicyForm, Shapes, count_numbers

LEAK = 0.01
"""The slope of leaky_relu below 0. Source: the default of PyTorch's LeakyReLU."""


def squash(x: Floats) -> Floats:
    """Returns the logistic function."""
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * x)))


ACTIVATIONS: Mapping[Activation, Callable[[Floats], Floats]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
    "leaky_relu": lambda x: np.where(x > 0, x, LEAK * x),
    "elu": lambda x: np.where(x > 0, x, np.expm1(np.minimum(x, 0.0))),
    "silu": lambda x: x * squash(x),
    "softplus": lambda x: np.logaddexp(0.0, x),
    "sigmoid": squash,
}


@dataclass(frozen=True, eq=False)
class Network:
    """A network: its layers (W, b), its functions, `low` and `high` of the actuators where its outputs are shares of
    their ranges, and mean and std of what it observes."""

    layers: tuple[tuple[Floats, Floats], ...]
    activation: Activation
    output: str
    limits: tuple[Floats, Floats] | None
    normalisation: tuple[Floats, Floats] | None = None

    def act(self, observed: Floats) -> Floats:
        """Returns the controls (nu,) for an observation, before they are clipped."""
        outputs = self.list_activations(observed)[-1]
        if self.limits is None:
            return outputs
        low, high = self.limits
        return np.asarray((low + high) / 2 + (high - low) / 2 * outputs)

    def list_activations(self, observed: Floats) -> list[Floats]:
        """Returns the outputs of every layer, for observations (..., n)."""
        x = observed
        if self.normalisation is not None:
            x = (x - self.normalisation[0]) / self.normalisation[1]
        activations = []
        for weights, bias in self.layers[:-1]:
            x = ACTIVATIONS[self.activation](x @ weights + bias)
            activations.append(x)
        weights, bias = self.layers[-1]
        x = x @ weights + bias
        return [*activations, np.tanh(x) if self.output == "tanh" else x]


def read_network(form: PolicyForm, shapes: Shapes, model: mujoco.MjModel, results: Results) -> Network | None:
    """Returns the policy that the driver submitted, which is a claim: None for what no driver submits."""
    weights, width = results.get("weights"), shapes["W1"][0]
    size = count_numbers(shapes)
    if weights is None or weights.dtype.kind != "f" or weights.shape not in ((size,), (size + 2 * width,)):
        return None
    numbers = weights.astype(np.float64)
    if not np.isfinite(numbers).all() or (numbers[size + width :] <= 0).any():
        return None
    ends = list(accumulate(map(prod, shapes.values())))
    arrays = {
        name: part.reshape(shape)
        for (name, shape), part in zip(shapes.items(), np.split(numbers[:size], ends[:-1]), strict=True)
    }
    layers = [
        (array, arrays.get(f"b{name[1:]}", np.zeros(array.shape[1])))
        for name, array in arrays.items()
        if name.startswith("W")
    ]
    normalisation = (numbers[size : size + width], numbers[size + width :]) if len(numbers) > size else None
    return Network(
        tuple(layers), form.activation, form.output, list_limits(model) if form.scales else None, normalisation
    )


def list_limits(model: mujoco.MjModel) -> tuple[Floats, Floats]:
    """Returns the ends of the actuators' ranges; -1 and 1 where one has none."""
    limited = model.actuator_ctrllimited.astype(bool)[:, None]
    low, high = np.where(limited, model.actuator_ctrlrange, [-1.0, 1.0]).T
    return low, high


def write_constant(form: PolicyForm, shapes: Shapes, output: float) -> str:
    """Returns in base64 a file whose last layer always has the same numbers, or 0 where there is no bias."""
    arrays: dict[str, Any] = {name: np.zeros(shape, np.float32) for name, shape in shapes.items()}
    if form.bias:
        arrays[[*arrays][-1]][:] = output
    written = io.BytesIO()
    np.savez(written, **arrays)
    return base64.b64encode(written.getvalue()).decode()
