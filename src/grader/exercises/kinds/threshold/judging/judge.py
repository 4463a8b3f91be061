"""Judges a claim by simulating at its ends: stable at the lower, unstable at the upper, in some reading of "stable".
The linear stability limit (the spectral radius of one step at rest passes 1) lies a little below the limit within the
horizon (a warning comes in time). Every reasonable reading of "stable" finds a limit between the two."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from grader.exercises.judgement import Judgement, Results
from grader.numerics.integrators import BY_NAME, Integrator
from grader.numerics.scene import Scene
from grader.numerics.stability.horizon import warns_within
from grader.numerics.stability.linear import RADIUS_NOISE, compute_spectral_radius

SLACK = 0.003
"""Relative widening of the span from the linear stability limit to the limit within the horizon, on both sides.

Source: right readings of the lesson's case measured at 19.93 (the energy decays) to 20.13 ms (other start angles)
under Euler, 24.90 to 25.23 ms under implicitfast, where the span is 19.983..20.116 and 24.970..25.194 ms. The nearest
wrong method (a horizon of 0.5 s) is 7 % away.
"""

WIDTH_ROUNDING = 1e-6
"""Relative tolerance of a width: 0.0200 - 0.0195 is a little more than 0.0005 in binary."""

NUMBER_TOLERANCE_S = 0.0005
"""A single number claims a limit within this distance [s]. Source: the lesson asks for a bisection to 0.5 ms."""


class SearchRange(Protocol):
    """What is searched: timesteps from the shortest to the longest, the horizon of a run and the widest bracket [s]."""

    @property
    def search_s(self) -> tuple[float, float]: ...  # noqa: D102

    @property
    def horizon_s(self) -> float: ...  # noqa: D102

    @property
    def width_s(self) -> float: ...  # noqa: D102

    @property
    def integrators(self) -> tuple[str, ...]: ...  # noqa: D102


class Cell(Protocol):
    """One model under one integrator: `scene` at its start, and `rest` in its equilibrium, None if there is none."""

    @property
    def case(self) -> str: ...  # noqa: D102

    @property
    def integrator(self) -> Integrator: ...  # noqa: D102

    @property
    def scene(self) -> Scene: ...  # noqa: D102

    @property
    def rest(self) -> Scene | None: ...  # noqa: D102


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
    def numbers(self) -> list[float]:
        """As the student returned it."""
        return [self.low, self.high] if self.number is None else [self.number]

    def scale(self, factor: float) -> "Bracket":
        """Returns the same digits in another unit."""
        if self.number is not None:
            return bracket_around(self.number * factor)
        return Bracket(self.low * factor, self.high * factor)

    def __str__(self) -> str:
        return " to ".join(f"{1000 * value:.6g}" for value in self.numbers) + " ms"


@dataclass(frozen=True)
class NoLimit:
    """`None`: no timestep up to the longest is unstable."""

    def __str__(self) -> str:
        return "None"


@dataclass(frozen=True)
class Unreadable:
    """Any other return value; `text` is its repr."""

    text: str

    def __str__(self) -> str:
        return self.text or "no readable value"


Claim = Bracket | NoLimit | Unreadable


def bracket_around(number: float) -> Bracket:
    """Returns the bracket that a single number claims."""
    return Bracket(number - NUMBER_TOLERANCE_S, number + NUMBER_TOLERANCE_S, number)


def read_claim(results: Results) -> Claim:
    """Returns the claim of the student's function; arrays that the driver never sends make it unreadable."""
    values: Any = results.get("claim")
    is_claim = values is not None and values.dtype == np.float64 and values.shape in ((0,), (1,), (2,))
    if not is_claim or not np.isfinite(values).all():
        text: Any = results.get("other")
        written = text.tobytes() if text is not None and text.dtype == np.uint8 else b""
        return Unreadable(written.decode(errors="replace")[:200])
    if values.size == 0:
        return NoLimit()
    if values.size == 1:
        return bracket_around(float(values[0]))
    return Bracket(float(values[0]), float(values[1]))


@lru_cache(maxsize=256)
def has_limit(scene: Scene, code: int, longest_s: float, seconds: float) -> bool:
    """Whether the longest timestep of the search is unstable."""
    return warns_within(scene, longest_s, seconds, integrator=code)


def grows(rest: Scene | None, code: int, timestep_s: float) -> bool:
    """Whether a small deviation from the equilibrium grows; False if there is no equilibrium."""
    return rest is not None and compute_spectral_radius(rest, timestep_s=timestep_s, integrator=code) > 1 + RADIUS_NOISE


def judge_claim(parameters: SearchRange, cell: Cell, claim: Claim) -> Judgement[Claim]:
    """Judges a claim; the message is the first fault found."""
    if isinstance(claim, Unreadable):
        why = "The function must return (h_stable, h_unstable) in seconds, one number, or None."
        return Judgement(False, why, claim)
    if isinstance(claim, NoLimit):
        return judge_none(parameters, cell, claim)
    detail = ""
    why = explain_form(parameters, claim)
    if why and claim.number is None and claim.width > parameters.width_s:
        detail = f"It is {1000 * claim.width:.6g} ms wide."
    why = why or explain_bracket(parameters, cell, claim)
    return Judgement(not why, why or "Certified by simulating at both ends.", claim, detail)


def judge_none(parameters: SearchRange, cell: Cell, claim: NoLimit) -> Judgement[Claim]:
    """Judges the claim that no timestep of the search is unstable. A right None counts only if a limit was found on the
    same model under another integrator that has one: otherwise a function that does nothing would earn points."""
    longest, seconds = parameters.search_s[1], parameters.horizon_s
    if has_limit(cell.scene, cell.integrator.code, longest, seconds):
        return Judgement(False, f"None was returned, but some timestep up to {1000 * longest:g} ms is unstable.", claim)
    others = (BY_NAME[name] for name in parameters.integrators if name != cell.integrator.name)
    needs = [
        f"{cell.case}.{integrator.name}"
        for integrator in others
        if has_limit(cell.scene, integrator.code, longest, seconds)
    ]
    return Judgement(
        True,
        "Certified by simulating at the longest timestep, which is stable.",
        claim,
        needs=tuple(needs),
        unmet="None is right here, but it counts only if you find a limit of the same model under another integrator.",
    )


def explain_form(parameters: SearchRange, claim: Bracket) -> str:
    """Returns the fault of a bracket that is wrong for any model; empty if there is none."""
    longest, allowed = parameters.search_s[1], parameters.width_s
    if claim.width < 0:
        return "The ends of the bracket are in the wrong order: it is (h_stable, h_unstable)."
    if claim.number is None and claim.width > allowed * (1 + WIDTH_ROUNDING):
        return f"The bracket is too wide: at most {1000 * allowed:g} ms are allowed."
    if claim.low > longest:
        return f"The bracket lies beyond {1000 * longest:g} ms, where the search ends."
    return "A timestep must be positive." if claim.high <= 0 else ""


def explain_bracket(parameters: SearchRange, cell: Cell, claim: Bracket) -> str:
    """Returns why a bracket misses the span of right readings; simulates and linearises at most once at each end."""
    scene, code, seconds = cell.scene, cell.integrator.code, parameters.horizon_s
    shortest, longest = parameters.search_s
    below, above = ("at the lower end", "at the upper end") if claim.number is None else ("just below", "just above")
    what = "of the bracket" if claim.number is None else "your number"
    if warns_within(scene, max(claim.low * (1 - SLACK), shortest), seconds, integrator=code):
        return f"Too high: the run is already unstable {below} {what}."
    high = max(claim.high * (1 + SLACK), shortest)
    if grows(cell.rest, code, high) or warns_within(scene, high, seconds, integrator=code):
        return ""
    if not has_limit(scene, code, longest, seconds):
        return f"No timestep up to {1000 * longest:g} ms is unstable here: return None."
    return f"Too low: the run is still stable {above} {what}."
