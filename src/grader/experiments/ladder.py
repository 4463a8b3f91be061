"""Refines the timestep of a measured number until its limit is known, or a budget of steps is spent."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf, log2
from typing import Any

from grader.experiments.regime import STEPS_MAX, Regime

CONTRACTS = 0.7
"""Largest ratio of two successive differences with which halving goes on."""

NEGLIGIBLE, GROWING = 0.02, 5.0
"""Differences that grow as the timestep shrinks, and exceed NEGLIGIBLE of what is allowed, say that none of the three
values is near the limit: the uncertainty is this many times as large."""

ORDERS = (1, 2, 3, 4)
ORDER_SLACK = 0.2
"""Distance of an observed order from a whole number at which it counts as that order."""


@dataclass
class Ladder:
    """The limit of `measure`, whose argument is how much shorter the timestep is, as the timestep goes to zero.

    `allowed` is the uncertainty at which the search ends; `missed` how far the incommensurate timestep is off.
    """

    measure: Callable[[float], float]
    regime: Regime
    allowed: float
    values: dict[float, float]
    best: float = inf
    uncertainty: float = inf
    missed: float = 0.0
    orders: list[float] = field(default_factory=list)
    incommensurate: float = inf

    def climb(self) -> None:
        """Halve until the uncertainty is allowed, the differences no longer contract, or the budget is spent."""
        level = self.regime.level
        while True:
            first, second = self._judge(level)
            certain = self.uncertainty <= self.allowed
            hopeless = second > CONTRACTS * first and self.missed <= max(first, second)
            if certain or hopeless or self.regime.steps * 2 ** (level + 3) > STEPS_MAX:
                return
            level += 1

    @property
    def finest(self) -> float:
        """The own timestep over the shortest one."""
        return max(self.values)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        other_s = self.regime.timestep_s / self.incommensurate
        return {"observed orders": self.orders, "incommensurate timestep [s]": other_s}

    def _read(self, finer: float) -> float:
        if finer not in self.values:
            self.values[finer] = self.measure(finer)
        return self.values[finer]

    def _judge(self, level: int) -> tuple[float, float]:
        """Find the best value of four timesteps and its uncertainty; returns the differences of the three halvings.

        The uncertainty is the largest difference, or that of the extrapolation where the order is clear.
        """
        coarse, middle, fine = (self._read(2.0 ** (level + k)) for k in range(3))
        first, second = abs(middle - coarse), abs(fine - middle)
        self.incommensurate = self.regime.choose_incommensurate(level)
        other = self._read(self.incommensurate)
        spread = max(abs(fine - coarse), second)
        if second > first and second > NEGLIGIBLE * self.allowed:
            spread *= GROWING
        self.missed = abs(other - fine)
        self.best, self.uncertainty = fine, max(spread, self.missed)
        if first > 0 and second > 0:
            self._extrapolate(level, coarse, middle, fine)
        return first, second

    def _extrapolate(self, level: int, coarse: float, middle: float, fine: float) -> None:
        """Take the limit by Richardson's extrapolation instead, where the order is clear and the doubt smaller.

        It must agree with that of the coarser pair, and predict the value at the incommensurate timestep.
        """
        order = log2(abs(middle - coarse) / abs(fine - middle))
        self.orders.append(round(order, 3))
        whole = min(ORDERS, key=lambda p: abs(p - order))
        if abs(whole - order) > ORDER_SLACK or (middle - coarse) * (fine - middle) < 0:
            return
        gain = 1 / (2**whole - 1)
        limit, before = fine + (fine - middle) * gain, middle + (middle - coarse) * gain
        predicted = limit + (coarse - limit) * (2.0**level / self.incommensurate) ** whole
        missed = abs(self.values[self.incommensurate] - predicted)
        doubt = max(abs(limit - before), missed)
        if doubt < self.uncertainty:
            self.best, self.uncertainty, self.missed = limit, doubt, missed
