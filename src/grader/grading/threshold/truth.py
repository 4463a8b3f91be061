"""What our own simulation says of a claim: stable at its lower end, unstable at its upper end, in some right reading.

The limit for ever (the spectral radius of one step at rest passes 1) is a little below the limit within the horizon
(a warning comes in time). Whoever reads "stable" in a reasonable way finds a limit between the two.
"""

from dataclasses import dataclass
from functools import lru_cache

from grader.grading.threshold.claims import Bracket, Claim, NoLimit, Unreadable
from grader.grading.threshold.parameters import Cell, ThresholdParameters
from grader.numerics.linear import RADIUS_NOISE, equilibrium, spectral_radius
from grader.numerics.scene import Scene
from grader.numerics.threshold import Outcome, try_timestep

SLACK = 0.003
"""Relative, on both sides of the span from the limit for ever to the limit within the horizon.

Source: right readings of the lesson's case measured at 19.93 (the energy decays) to 20.13 ms (other start angles)
under Euler, 24.90 to 25.23 ms under implicitfast, where the span is 19.983..20.116 and 24.970..25.194 ms. The nearest
wrong method (a horizon of 0.5 s) is 7 % away.
"""

WIDTH_ROUNDING = 1e-6
"""Relative: 0.0200 - 0.0195 is a little more than 0.0005 in binary."""


@dataclass(frozen=True)
class Judged:
    """A cell, its claim, and the outcome; `why` is what is wrong, without numbers of the model."""

    cell: Cell
    claim: Claim
    right: bool
    why: str = ""


def warns(scene: Scene, code: int, timestep_s: float, seconds: float) -> bool:
    """Whether a run of `seconds` [s] from the scene's start raises any warning."""
    return try_timestep(scene, timestep_s, seconds, integrator=code).outcome is Outcome.UNSTABLE


@lru_cache(maxsize=64)
def at_rest(scene: Scene) -> Scene | None:
    """The scene in its equilibrium, which takes a root search: once for each scene."""
    return equilibrium(scene)


def grows(scene: Scene, code: int, timestep_s: float) -> bool:
    """Whether a small deviation from the equilibrium grows for ever; False where there is no equilibrium."""
    rest = at_rest(scene)
    return rest is not None and spectral_radius(rest, timestep_s=timestep_s, integrator=code) > 1 + RADIUS_NOISE


def judge_claim(parameters: ThresholdParameters, cell: Cell, claim: Claim) -> Judged:
    """Right, or the first thing that is wrong."""
    if isinstance(claim, Unreadable):
        why = "The function must return (h_stable, h_unstable) in seconds, one number, or None"
    elif isinstance(claim, NoLimit):
        why = none_complaint(parameters, cell)
    else:
        why = form_complaint(parameters, claim) or bracket_complaint(parameters, cell, claim)
    return Judged(cell, claim, not why, why)


def none_complaint(parameters: ThresholdParameters, cell: Cell) -> str:
    """Whether nothing in the search is unstable."""
    longest = parameters.search_s[1]
    if not warns(cell.scene, cell.code, longest, parameters.horizon_s):
        return ""
    return f"None was returned, but some timestep up to {1000 * longest:g} ms is unstable"


def form_complaint(parameters: ThresholdParameters, claim: Bracket) -> str:
    """What is wrong with a bracket whatever the model."""
    longest, allowed = parameters.search_s[1], parameters.width_s
    if claim.width < 0:
        return "The ends of the bracket are in the wrong order: it is (h_stable, h_unstable)"
    if claim.number is None and claim.width > allowed * (1 + WIDTH_ROUNDING):
        return f"The bracket is {1000 * claim.width:.6g} ms wide; at most {1000 * allowed:g} ms are allowed"
    if claim.low > longest:
        return f"The bracket lies beyond {1000 * longest:g} ms, where the search ends"
    if claim.high <= 0:
        return "A timestep must be positive"
    return ""


def bracket_complaint(parameters: ThresholdParameters, cell: Cell, claim: Bracket) -> str:
    """Whether the bracket meets the span of right readings: one run and one linearisation at most at each end."""
    scene, code, seconds = cell.scene, cell.code, parameters.horizon_s
    shortest, longest = parameters.search_s
    below, above = ("at the lower end", "at the upper end") if claim.number is None else ("just below", "just above")
    what = "of the bracket" if claim.number is None else "your number"
    if warns(scene, code, max(claim.low * (1 - SLACK), shortest), seconds):
        return f"Too high: the run is already unstable {below} {what}"
    high = max(claim.high * (1 + SLACK), shortest)
    if grows(scene, code, high) or warns(scene, code, high, seconds):
        return ""
    if not warns(scene, code, longest, seconds):
        return f"Nothing up to {1000 * longest:g} ms is unstable here: return None"
    return f"Too low: the run is still stable {above} {what}"
