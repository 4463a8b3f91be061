"""What the judge of values knows of a function and its calls."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from grader.exercises.kinds.values.judging.driver import Rows


class Result(Protocol):
    """One result, with its tolerance: `atol` [its unit] plus `rtol` times the largest expected element."""

    @property
    def name(self) -> str: ...  # noqa: D102

    @property
    def field(self) -> str | None: ...  # noqa: D102

    @property
    def unit(self) -> str: ...  # noqa: D102

    @property
    def atol(self) -> float: ...  # noqa: D102

    @property
    def rtol(self) -> float: ...  # noqa: D102


class Residual(Protocol):
    """A function of the author's program that must return about 0."""

    @property
    def function(self) -> str: ...  # noqa: D102

    @property
    def title(self) -> str | None: ...  # noqa: D102

    @property
    def atol(self) -> float: ...  # noqa: D102

    @property
    def unit(self) -> str: ...  # noqa: D102


class Function(Protocol):
    """A function that the student writes."""

    @property
    def results(self) -> Sequence[Result]: ...  # noqa: D102

    @property
    def residual(self) -> Residual | None: ...  # noqa: D102


@dataclass(frozen=True)
class Call:
    """The arguments of one call as plain JSON, and the state in which `data` is given."""

    arguments: tuple[Any, ...]
    start: Mapping[str, Any]

    def inputs(self) -> dict[str, Any]:
        """Returns the call as the driver reads it."""
        return {"arguments": list(self.arguments), "start": dict(self.start)}


class RanTooLong(Exception):
    """A function of the author's program that does not end for these results."""


class Problem(Protocol):
    """The calls of one trial. The expected results are None where a residual decides."""

    @property
    def function(self) -> Function: ...  # noqa: D102

    @property
    def calls(self) -> Sequence[Call]: ...  # noqa: D102

    def compute_expected(self, call: Call) -> tuple[Rows, ...] | None: ...  # noqa: D102

    def list_shapes(self, call: Call) -> list[tuple[int, ...] | None]: ...  # noqa: D102

    def compute_remainder(self, call: Call, values: tuple[Rows, ...]) -> Rows | None: ...  # noqa: D102
