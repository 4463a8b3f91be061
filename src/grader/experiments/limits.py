"""Measures a number of a motion: its limit as the timestep goes to zero, with the uncertainty, and what fails if it has
none. Three timesteps, one that is no simple fraction of them, and nudged starts must agree."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from grader.domain.lab import SECONDS_MAX
from grader.experiments.ladder import Ladder
from grader.experiments.quantities import Floats
from grader.experiments.regime import STEPS_MAX, Regime, check_regime
from grader.experiments.runs import NUDGED, PROBES, LabRun, Variant, list_more_nudged

UNCERTAINTY_SHARE = 0.2
"""Largest numerical uncertainty of a known number, as a share of its tolerance."""

WHOLE = 1e-6
"""Distance from a whole number at which a run counts as that many steps: rounding of the sum of the timesteps."""

LONGER, MUCH_LONGER, ENOUGH = 1.5, 2.5, 1.2
"""How many times as long a run is, and at least has to be, that shows whether something has settled: then it settles at
the same time."""

Measure = Callable[[Variant], tuple[LabRun, float]]
"""Returns a run and the number that was measured in it. Raises RegimeFailure."""


@dataclass(frozen=True)
class MotionLimit:
    """A number of the motion: its limit `value`, and what else was measured.

    `own` is the number at the model's own timestep, in the run `run`; `nudged` the numbers from nudged starts. `failed`
    is the condition because of which the number stays uncertain, with its `cure`.
    """

    value: float
    uncertainty: float
    own: float
    run: LabRun
    regime: Regime
    ladder: Ladder
    nudged: list[float]
    noise: float
    failed: str
    cure: str

    def to_json(self) -> dict[str, Any]:
        """Plain JSON of the regime and of what was varied."""
        return {**self.regime.to_json(self.ladder.finest), **self.ladder.to_json(), "round-off": self.noise}


def find_limit(measure: Measure, allowed: float, *, to_the_end: bool, fastest: float | None = None) -> MotionLimit:
    """Measure a number until its uncertainty is `allowed`, or no shorter timestep helps.

    `to_the_end` and `fastest` are as for `check_regime`. Raises RegimeFailure.
    """
    run, own = measure(Variant(probes=PROBES))
    regime = check_regime(run, to_the_end=to_the_end, fastest=fastest)
    ladder = Ladder(lambda finer: measure(Variant(finer=finer))[1], regime, allowed, {1.0: own})
    ladder.climb()
    nudged = measure_nudged(measure, regime.first)
    noise = max(abs(ladder.values[regime.first] - other) for other in nudged)
    failed, cure = find_failure(ladder, noise)
    if to_the_end and failed != "nudged starts" and (odd := describe_odd_length(run)):
        failed, cure = "whole steps", odd
    return MotionLimit(
        ladder.best, max(ladder.uncertainty, noise), own, run, regime, ladder, nudged, noise, failed, cure
    )


def measure_nudged(measure: Measure, finer: float = 1.0) -> list[float]:
    """Returns what is measured from nudged starts, from more of them where these part. Raises RegimeFailure."""
    readings = [measure(replace(each, finer=finer)) for each in NUDGED]
    more = list_more_nudged([run for run, _ in readings])
    return [value for _, value in readings] + [measure(replace(each, finer=finer))[1] for each in more]


def find_failure(ladder: Ladder, noise: float) -> tuple[str, str]:
    """Returns the condition because of which a number stays uncertain, and what the author may change."""
    if noise >= ladder.uncertainty:
        return "nudged starts", describe_noise(noise)
    is_missed = ladder.missed >= 0.5 * ladder.uncertainty
    failed = "incommensurate timestep" if is_missed else "converged"
    if ladder.regime.steps * 2 * ladder.finest > STEPS_MAX:
        return failed, (
            f"it still changes with the timestep, and a run takes {STEPS_MAX:,} steps at most: end it where the key is "
            "read, with fewer seconds, or give a larger tol"
        )
    if is_missed:
        return failed, (
            "a timestep that is no simple fraction of the others disagrees, as where a force changes faster than the "
            "timestep: shorten the model's timestep, or give a larger tol"
        )
    return failed, (
        "it still changes with the timestep: shorten the model's timestep, give a larger tol, or write "
        '"timestep": "given"'
    )


def describe_odd_length(run: LabRun) -> str | None:
    """Returns what to write where the run is no whole number of timesteps, so that each timestep ends elsewhere."""
    timestep_s = run.duration_s / max(run.steps, 1)
    steps = run.seconds / timestep_s
    whole = max(1, round(steps))
    if abs(steps - whole) <= WHOLE:
        return None
    return (
        f"{run.seconds:g} s are no multiple of the timestep {timestep_s:g} s, so that runs at other timesteps end at "
        f"other times: write seconds {whole * timestep_s:.9g}, or the timestep {run.seconds / whole:.9g} in the model"
    )


def explain_change(name: str, waves: Floats, value: float, allowed: float) -> str | None:
    """Says that a quantity differs from wave to wave, and what to ask for instead. A learner who measures one wave gets
    another number than `value`, that of all waves. None where every wave has it within `allowed`."""
    if not len(waves) or np.abs(waves - value).max() <= allowed:
        return None
    return (
        f"the {name.replace('_', ' ')} changes during the run: single waves have {waves.min():.6g} to "
        f"{waves.max():.6g}, all together {value:.6g}, and {allowed:.3g} is allowed: name a part of the run with since "
        "and until, give the level about which it swings, or allow more"
    )


def list_other_ends(end_s: float, *, is_part: bool) -> list[float]:
    """Returns when runs end [s] that show whether another, which ends at `end_s`, has settled: later and much later, as
    a beat is quiet for a while, or earlier where labs may hardly last longer. Where the other is a part of a run, one
    that ends later or earlier will do: after it something else may begin."""
    later = dict.fromkeys(min(factor * end_s, SECONDS_MAX) for factor in (LONGER, MUCH_LONGER))
    ends = [end for end in later if end > ENOUGH * end_s]
    return [*ends[:1], end_s / LONGER] if is_part or not ends else ends


def explain_unsettled(settled: float, others: Mapping[float, float], allowed: float, *, is_part: bool) -> str | None:
    """Says that something which `settled` at a time of a run moves on after its end: runs that end at other times [s]
    have `others`, NaN where it does not settle. None where they agree within `allowed`, one of them of a part."""
    apart = {end_s: other for end_s, other in others.items() if not abs(other - settled) <= allowed}
    if not apart or (is_part and len(apart) < len(others)):
        return None
    end_s, other = next(iter(apart.items()))
    then = f"at {other:.6g}" if isfinite(other) else "at no time"
    return (
        f"it has not settled when the run ends: in one of {end_s:g} s it settles {then}, not at {settled:.6g}: "
        "make the run longer, or give the level at which it comes to rest"
    )


def describe_noise(noise: float) -> str:
    """Says that the start decides, and what to ask for instead."""
    cure = "ask for something earlier or less sensitive, or give a larger tol"
    return f"a start nudged by 1e-10 changes it by {noise:.2g}: {cure}"
