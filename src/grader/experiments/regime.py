"""Checks the regime in which a derived key is about the motion itself, not about the timestep.

A value on which three timesteps agree may still be false: all three may be too long for the fastest motion, may damp
away the same mode, or may meet a periodic force in the same phase. Therefore MuJoCo must not have reset the state, the
longest timestep must resolve the motion, and a timestep that is no simple fraction of the others must agree.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import ceil, isfinite, log2
from typing import Any

import numpy as np

from grader.domain.verify import Simulation
from grader.experiments.runs import NUDGED, PROBES, SAME, LabRun, Variant, list_more_nudged

RESOLVED = 1.0
"""The largest product of timestep and fastest rate: six steps a period at the longest of three timesteps, 25 at the
shortest. Source: measured; the peak of a free swing is then known to 1 % at the shortest."""

SHORTEST = 4.0
"""The longest of three timesteps over the shortest, in which no geom may fly through the thinnest one."""

OVERDAMPED = 0.1
"""Share of the imaginary part below which a decaying mode follows the others, and needs no resolution at the end."""

LASTS, LOST = 4.0, 1.0
"""A mode lasts if it decays by less than exp(-LASTS) over the run; a timestep loses it if it alone takes another factor
exp(-LOST). Then all timesteps agree on a motion that is damped by them."""

COUNTED = 4
"""Probes at which lasting modes are counted."""

STEPS_MAX = 100_000
"""Most steps of one run."""

GOLDEN = 1.6180339887498949
"""The ratio that is farthest from every simple fraction."""


CLIMBS = 3
"""Most further halvings for a claim that depends on the timestep."""

Reading = tuple[Any, Any]
"""What a run says of a claim, True or False or one for each claim, and what was measured."""


class RegimeFailure(Exception):
    """The regime does not hold: the name of the `condition` that failed, and a sentence with the cure."""

    def __init__(self, condition: str, why: str) -> None:
        self.condition = condition
        super().__init__(why)


@dataclass(frozen=True)
class Regime:
    """The run at the model's own timestep [s], the fastest rate [1/s] along it, and how often to halve the timestep."""

    timestep_s: float
    steps: int
    fastest: float
    level: int

    @property
    def first(self) -> float:
        """By how much the longest timestep that resolves the motion is shorter than the own one."""
        return 2.0**self.level

    def choose_incommensurate(self, level: int) -> float:
        """Returns how much shorter a timestep is that is no simple fraction of those halved `level` times and more."""
        return (ceil(self.steps * 2.0**level * GOLDEN) | 1) / self.steps

    def to_json(self, finest: float) -> dict[str, Any]:
        """Plain JSON; `finest` is the own timestep over the shortest one."""
        return {
            "failed": None,
            "own timestep [s]": self.timestep_s,
            "fastest rate [1/s]": self.fastest,
            "longest timestep times rate": self.fastest * self.timestep_s / self.first,
            "shortest timestep [s]": self.timestep_s / finest,
        }


def explain_window(until: float | None, seconds: float) -> str | None:
    """Returns why a window cannot end at `until` [s], in a run of so many seconds; None where it can."""
    if until is None or until <= seconds:
        return None
    return f"the run ends after {seconds:g} s: write more `seconds`, or an earlier `until`"


def describe_reset(run: LabRun) -> str:
    """Says why a run in which MuJoCo warned cannot be read to its end."""
    first = run.warnings[0]
    return (
        f"MuJoCo warned of {first.kind} at {first.time_s:g} s and reset the state, so that the rest of the run began "
        "anew: give the model a shorter timestep, or ask which setting is `stable`"
    )


def check_regime(run: LabRun, *, to_the_end: bool, fastest: float | None = None) -> Regime:
    """Find the timestep that resolves the motion of a run with probes at the model's own timestep.

    Where only the end of the run is read (`to_the_end`), what decays without swinging needs no resolution. `fastest` is
    the author's bound of the rate [1/s]. Raises RegimeFailure.
    """
    timestep_s = run.duration_s / max(run.steps, 1)
    rate = max(_find_fastest(run, to_the_end=to_the_end), fastest or 0.0)
    if not isfinite(rate):
        raise RegimeFailure("resolved", "the equations of motion could not be linearised along the run")
    level = max(0, ceil(log2(rate * timestep_s / RESOLVED))) if rate > 0 else 0
    while run.steps * 2 ** (level + 2) <= STEPS_MAX and _loses_mode(run, timestep_s / 2 ** (level + 2)):
        level += 1
    if level and run.steps * 2 ** (level + 2) > STEPS_MAX:
        needed = f"above {timestep_s / 2**level:.2g} s, and the own timestep is {timestep_s:.3g} s"
        cure = (
            "make the model less stiff or the run shorter, or write "
            '"timestep": "given" for a key about the discretisation'
        )
        raise RegimeFailure(
            "resolved", f"the fastest motion, {rate:.3g} 1/s, is not resolved by timesteps {needed}: {cure}"
        )
    return Regime(timestep_s, run.steps, rate, level)


def _find_fastest(run: LabRun, *, to_the_end: bool) -> float:
    """Returns the fastest rate [1/s] along a run."""
    fastest = 0.0
    for probe in run.probes:
        size = np.abs(probe.rates)
        following = to_the_end & (probe.rates.real < 0) & (np.abs(probe.rates.imag) <= OVERDAMPED * size)
        fastest = max(fastest, float(size[~following].max(initial=0.0)), probe.crossing / SHORTEST)
    return fastest


def _loses_mode(run: LabRun, timestep_s: float) -> bool:
    """Whether fewer modes last in the run at this timestep than in the exact motion, at any of COUNTED probes."""
    seconds = run.duration_s
    for probe in run.probes[:: max(1, len(run.probes) // COUNTED)]:
        lasting = int(np.sum(probe.rates.real * seconds > -LASTS))
        if lasting and int(np.sum(probe.compute_growth_rates(timestep_s) * seconds > -LASTS - LOST)) < lasting:
            return True
    return False


def compare_runs(
    read: Callable[[Variant], Reading], probe: Callable[[Variant], LabRun], verify: Simulation, *, to_the_end: bool
) -> tuple[list[Reading], dict[str, Any]]:
    """Returns what the runs that must agree give, and the regime as JSON. Raises RegimeFailure.

    Where they do not agree because of the timestep alone, it is halved further, CLIMBS times at most.
    """
    checked: dict[str, Any] = {"timestep": verify.timestep, "failed": None}
    if verify.timestep == "given":
        more = list_more_nudged([probe(variant) for variant in NUDGED])
        return [read(variant) for variant in (SAME, *NUDGED, *more)], checked
    regime = check_regime(probe(Variant(probes=PROBES)), to_the_end=to_the_end, fastest=verify.fastest)
    read, more = cache(read), list_more_nudged([probe(variant) for variant in NUDGED])
    own = [SAME] if verify.timestep == "both" else []
    for level in range(regime.level, regime.level + CLIMBS + 1):
        first = 2.0**level
        timesteps = [Variant(finer=each) for each in (first, 2 * first, 4 * first, regime.choose_incommensurate(level))]
        nudged = [replace(each, finer=first) for each in (*NUDGED, *more)]
        readings = [read(variant) for variant in (*own, *timesteps, *nudged)]
        ends = [read(variant)[0] for variant in (timesteps[2], *own)]
        starts = [read(variant)[0] for variant in (timesteps[0], *nudged)]
        is_decided = all(truth == readings[0][0] for truth, _ in readings)
        is_hopeless = any(end != ends[0] for end in ends) or any(start != starts[0] for start in starts)
        if is_decided or is_hopeless or regime.steps * 2 ** (level + 3) > STEPS_MAX:
            break
    return readings, checked | regime.to_json(4 * first)
