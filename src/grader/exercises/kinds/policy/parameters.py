"""The parameters of a `policy` exercise: the form of the file, and the episodes that the policy must pass."""

from collections.abc import Mapping
from itertools import pairwise
from math import prod
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from grader.domain.numbers import Positive, Real
from grader.exercises.episodes.parameters import EpisodesParameters
from grader.exercises.parameters import Strict

NUMBERS_MAX = 50_000
"""Most numbers of a policy: as float32 they are 200 KB, and a file has at most 256."""

Activation = Literal["tanh", "relu", "leaky_relu", "elu", "silu", "softplus", "sigmoid"]
Width = Annotated[int, Field(ge=1, le=512)]
Shapes = Mapping[str, tuple[int, ...]]


class PolicyForm(Strict):
    """A feed-forward network: `x @ W1 + b1`, an `activation`, `x @ W2 + b2`, and so on, with one hidden layer for each
    number of `hidden`; the last layer has its `output` function alone. `linear` has no hidden layer. `actions` says
    what the outputs are: `controls`, or shares of the actuators' `range` from -1 to 1, which is the default behind a
    tanh. Without `bias` there is no b1, b2, ..."""

    kind: Literal["linear", "mlp"]
    hidden: tuple[Width, ...] = Field(default=(), max_length=4)
    activation: Activation = "tanh"
    output: Literal["linear", "tanh"] = "linear"
    actions: Literal["controls", "range"] | None = None
    bias: bool = True

    @model_validator(mode="after")
    def _check(self) -> Self:
        if bool(self.hidden) == (self.kind == "linear"):
            raise ValueError('"hidden" is for "mlp" alone' if self.hidden else 'give "hidden", the sizes of the layers')
        return self

    @property
    def scales(self) -> bool:
        """Whether the outputs are shares of the actuators' ranges."""
        return self.actions == "range" or (self.actions is None and self.output == "tanh")

    def list_shapes(self, observed: int, controls: int) -> Shapes:
        """Returns the shape of each array that a file must have, layer by layer: W1, b1, W2, ..."""
        widths = (observed, *self.hidden, controls)
        shapes: dict[str, tuple[int, ...]] = {}
        for layer, (rows, columns) in enumerate(pairwise(widths), 1):
            shapes[f"W{layer}"] = (rows, columns)
            if self.bias:
                shapes[f"b{layer}"] = (columns,)
        return shapes

    def list_functions(self) -> list[str]:
        """Returns the function behind each layer."""
        return [*[self.activation] * len(self.hidden), self.output]


class Normalisation(Strict):
    """The mean and the standard deviation by which training divides what is observed, one number for each."""

    mean: tuple[Real, ...] = Field(min_length=1, max_length=1000)
    std: tuple[Positive, ...] = Field(min_length=1, max_length=1000)


class PolicyParameters(EpisodesParameters):
    """`program` is the path of an author's program whose functions `observe`, `reward`, `terminated` and `reset` are
    those of an environment. `normalisation`, that of the training which learners were given, names a mistake and
    changes no observation."""

    form: PolicyForm
    program: str | None = None
    normalisation: Normalisation | None = None


def count_numbers(shapes: Shapes) -> int:
    """Returns how many numbers arrays of these shapes have."""
    return sum(map(prod, shapes.values()))
