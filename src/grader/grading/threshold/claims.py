"""What a student's function returned: a bracket, a single number, None, or something that is none of these."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

NUMBER_TOLERANCE_S = 0.0005
"""A single number h claims that the limit lies this near. Source: the lesson asks for a bisection to 0.5 ms."""


@dataclass(frozen=True)
class Bracket:
    """Stable at `low`, unstable at `high` [s]; `number` is the single value that was given instead of both."""

    low: float
    high: float
    number: float | None = None

    @property
    def width(self) -> float:
        """[s]; negative where the ends are swapped."""
        return self.high - self.low

    @property
    def given(self) -> list[float]:
        """As the student returned it."""
        return [self.low, self.high] if self.number is None else [self.number]

    def scaled(self, factor: float) -> "Bracket":
        """The same digits in another unit."""
        if self.number is not None:
            return number(self.number * factor)
        return Bracket(self.low * factor, self.high * factor)


@dataclass(frozen=True)
class NoLimit:
    """`None`: nothing up to the longest timestep is unstable."""


@dataclass(frozen=True)
class Unreadable:
    """Anything else; `text` is how Python shows it."""

    text: str


Claim = Bracket | NoLimit | Unreadable


def number(value: float) -> Bracket:
    """The bracket that a single number claims."""
    return Bracket(value - NUMBER_TOLERANCE_S, value + NUMBER_TOLERANCE_S, value)


def read_claim(results: Mapping[str, NDArray[np.generic]], index: int) -> Claim:
    """The claim of call `index`; what is missing or not as the driver writes it is unreadable."""
    values: Any = results.get(f"claim{index}")
    if values is None or values.dtype != np.float64 or values.ndim != 1 or values.size > 2:
        text = results.get(f"other{index}", np.empty(0, np.uint8))
        return Unreadable(bytes(text.astype(np.uint8)).decode(errors="replace")[:200])
    if values.size == 0:
        return NoLimit()
    if values.size == 1:
        return number(float(values[0]))
    return Bracket(float(values[0]), float(values[1]))


def shown(claim: Claim) -> str:
    """A claim in words: milliseconds to a hundredth."""
    if isinstance(claim, Unreadable):
        return claim.text or "nothing that can be read"
    if isinstance(claim, NoLimit):
        return "None"
    return " to ".join(f"{1000 * value:.6g}" for value in claim.given) + " ms"
