"""The regime in which a number or a claim is about the motion itself, not about the timestep: what is checked, and why.

A value that three timesteps agree on may still be false: all three may be too long for the fastest motion, or all may
meet a periodic force in the same phase. So the motion must be resolved (the longest timestep times the fastest rate
below RESOLVED), MuJoCo must not have reset the state, and a timestep that is no simple fraction of the others must
agree. Where the model's own timestep is too long, shorter ones are tried within a budget of steps.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil, inf, isfinite, log2
from typing import Any

import numpy as np

from grader.certify.experiments import LabRun, Variant

RESOLVED = 1.0
"""The largest product of timestep and fastest rate: six steps a period at the longest of three timesteps, 25 at the
shortest. Source: measured; the peak of a free swing is then known to 1 % at the shortest."""

SHORTEST = 4.0
"""The longest of three timesteps over the shortest, in which no geom may fly through the thinnest one."""

OVERDAMPED = 0.1
"""Share of the imaginary part below which a decaying mode follows the others, and needs no resolution at the end."""

STEPS_MAX = 100_000
"""Most steps of one run."""

GOLDEN = 1.6180339887498949
"""The ratio that is farthest from every simple fraction."""

CONTRACTS = 0.7
"""Largest ratio of two successive differences with which halving goes on."""

NEGLIGIBLE = 0.02
GROWING = 5.0
"""Differences that grow as the timestep shrinks, and are no rounding, say that none of the three is near the limit."""

ORDERS = (1, 2, 3, 4)
ORDER_SLACK = 0.2
"""Distance of an observed order from a whole number at which it counts as that order."""


class Unresolved(Exception):
    """The regime does not hold; the argument is a sentence with its cure."""


@dataclass(frozen=True)
class Regime:
    """Conditions that were checked: the longest timestep [s], the fastest rate [1/s], observed orders, timesteps."""

    timestep_s: float
    fastest: float
    finer: tuple[float, ...]
    orders: tuple[float, ...] = ()
    incommensurate_s: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {
            "own timestep [s]": self.timestep_s,
            "fastest rate [1/s]": self.fastest,
            "resolved: timestep times rate": self.fastest * self.timestep_s / self.finer[0] if self.finer else None,
            "finer": list(self.finer),
            "observed orders": list(self.orders),
            "incommensurate timestep [s]": self.incommensurate_s,
            "resets": 0,
        }


def describe_reset(run: LabRun) -> str | None:
    """Why a run cannot be read to its end: MuJoCo reset its state. None if it did not."""
    if not run.warnings:
        return None
    first = run.warnings[0]
    return (
        f"MuJoCo warned of {first.kind} at {first.time_s:g} s and reset the state, so that the rest of the run began "
        "anew: give the model a shorter timestep, or ask which setting is `stable`"
    )


def compute_timestep_s(run: LabRun) -> float:
    """The mean timestep [s] of a run."""
    return run.duration_s / max(run.steps, 1)


def find_fastest(run: LabRun, *, to_the_end: bool) -> float:
    """The fastest rate [1/s] along a run. What decays without swinging does not count where only the end is read."""
    found = 0.0
    for probe in run.probes:
        size = np.abs(probe.rates)
        slaved = to_the_end & (probe.rates.real < 0) & (np.abs(probe.rates.imag) <= OVERDAMPED * size)
        found = max(found, float(size[~slaved].max(initial=0.0)), probe.crossing / SHORTEST)
    return found


LASTS, LOST = 4.0, 1.0
"""A mode lasts if it decays by less than exp(-LASTS) over the run; it is lost if the discretisation alone, at the
shortest timestep, takes another factor exp(-LOST). Then all timesteps agree on a motion that is damped by them."""


def is_damped_away(run: LabRun, timestep_s: float) -> bool:
    """Whether a timestep damps a mode away that lasts in the exact motion, by a count of modes at each probed state."""
    seconds = run.duration_s
    for probe in run.probes[:: max(1, len(run.probes) // 3)]:
        lasting = int(np.sum(probe.rates.real * seconds > -LASTS))
        if lasting and int(np.sum(probe.compute_decays(timestep_s) * seconds > -LASTS - LOST)) < lasting:
            return True
    return False


def find_first_level(run: LabRun, *, to_the_end: bool) -> tuple[int, float]:
    """How often the timestep is halved until the motion is resolved, and the fastest rate. Raises Unresolved."""
    fastest, timestep_s = find_fastest(run, to_the_end=to_the_end), compute_timestep_s(run)
    if not isfinite(fastest):
        raise Unresolved("the equations of motion could not be linearised along the run")
    level = max(0, ceil(log2(fastest * timestep_s / RESOLVED))) if fastest > 0 else 0
    while run.steps * 2 ** (level + 2) <= STEPS_MAX and is_damped_away(run, timestep_s / 2 ** (level + 2)):
        level += 1
    if level and run.steps * 2 ** (level + 2) > STEPS_MAX:
        raise Unresolved(
            f"the fastest motion, {fastest:.3g} 1/s, is not resolved by timesteps above {RESOLVED / fastest:.2g} s, and "
            f"the own timestep is {timestep_s:.3g} s: make the model less stiff or the run shorter, or write timestep "
            "given if the question is about the discretisation"
        )
    return level, fastest


def choose_incommensurate(run: LabRun, level: int) -> float:
    """By how much a timestep is finer that is no simple fraction of the others: between halving `level` times and once more."""
    steps = run.steps * 2.0**level
    return (ceil(steps * GOLDEN) | 1) / run.steps


@dataclass
class Ladder:
    """Values of a number at ever shorter timesteps, until they are certain or the budget of steps is spent."""

    value: Callable[[Variant], float]
    own: LabRun
    level: int
    fastest: float
    allowed: float
    values: dict[float, float] = field(default_factory=dict)
    best: float = inf
    uncertainty: float = inf
    orders: tuple[float, ...] = ()
    incommensurate: float | None = None
    missed: float = 0.0

    def climb(self, own: float) -> None:
        """Halve until the uncertainty is allowed, the differences no longer contract, or the budget ends."""
        self.values[1] = own
        base = self.level
        for level in range(base, base + 3):
            self.at(2.0**level)
        while True:
            top = max(k for k in range(64) if 2.0**k in self.values)
            self.judge(top)
            if self.uncertainty <= self.allowed or self.own.steps * 2 ** (top + 1) > STEPS_MAX:
                return
            first, second = self.differences(top)
            if not (second <= CONTRACTS * first or self.missed > max(first, second)):
                return
            self.at(2.0 ** (top + 1))

    def at(self, finer: float) -> float:
        if finer not in self.values:
            self.values[finer] = self.value(Variant(finer=finer))
        return self.values[finer]

    def differences(self, top: int) -> tuple[float, float]:
        a, b, c = (self.values[2.0 ** (top - k)] for k in (2, 1, 0))
        return abs(b - a), abs(c - b)

    def judge(self, top: int) -> None:
        """The best value with its uncertainty: the whole difference, or the extrapolation's where the order is clear."""
        coarse, middle, fine = (self.values[2.0 ** (top - k)] for k in (2, 1, 0))
        first, second = self.differences(top)
        plain = max(abs(fine - coarse), second)
        if second > first and second > NEGLIGIBLE * self.allowed:
            plain *= GROWING
        other = choose_incommensurate(self.own, top - 2)
        golden = self.at(other)
        self.incommensurate = other
        self.best, self.uncertainty, self.missed = fine, max(plain, abs(golden - fine)), abs(golden - fine)
        if not (first > 0 and second > 0):
            return
        order = log2(first / second)
        self.orders = (*self.orders, round(order, 3))
        whole = min(ORDERS, key=lambda p: abs(p - order))
        if abs(whole - order) > ORDER_SLACK or (middle - coarse) * (fine - middle) < 0:
            return
        gain = 1 / (2**whole - 1)
        limit = fine + (fine - middle) * gain
        # The extrapolation from the coarser pair, and what it foretells at the incommensurate timestep, must agree.
        before = middle + (middle - coarse) * gain
        foretold = limit + (coarse - limit) * (2 ** (top - 2) / other) ** whole
        doubt = max(abs(limit - before), abs(golden - foretold))
        if doubt < self.uncertainty:
            self.best, self.uncertainty, self.missed = limit, doubt, abs(golden - foretold)
