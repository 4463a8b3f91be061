"""Finds how a change is made up of slopes: the simplest linear combination that gives it to round-off."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float64]

RESIDUAL = 1e-12
"""The largest residual of a combination that explains a change, relative to the largest part of it."""

ROUND_OFF = 2e-15
"""Round-off of a state, relative to its largest number."""

CONDITION_MAX = 1e8
"""Slopes that are more alike leave the coefficients open."""

TERMS_MAX = 32
"""More terms are not tried."""

COEFFICIENT_MIN = 1e-9
"""A coefficient below this is none."""


@dataclass(frozen=True, order=True)
class Term:
    """A slope times a power of h. `stage` counts from 1; 0 is the start of the step."""

    slope: str
    stage: int
    power: int = 1


Combination = Mapping[Term, float]


@dataclass(frozen=True, eq=False)
class System:
    """Changes (n,) with their tolerances (n,), over some steps at once, and the terms (n,) that may make them up."""

    change: Rows
    tolerance: Rows
    terms: Mapping[Term, Rows]

    def compute_residual(self, combination: Combination) -> Rows:
        """Returns what a combination leaves of the change, relative to the tolerance; inf for an unknown term."""
        if not combination.keys() <= self.terms.keys():
            return np.full(len(self.change), np.inf)
        total = np.zeros(len(self.change))
        for term, coefficient in combination.items():
            total += coefficient * self.terms[term]
        return np.array(np.abs(total - self.change) / self.tolerance)

    def explains(self, combination: Combination) -> bool:
        """Whether a combination gives the change to round-off."""
        return bool(np.all(self.compute_residual(combination) <= 1))

    def solve(self, terms: Sequence[Term]) -> Combination | None:
        """Returns the combination of these terms that gives the change; None if there is none, or more than one."""
        known = self.select_independent(terms) if len(terms) <= TERMS_MAX else []
        if not known or len(self.change) <= len(known):
            return None
        columns = np.stack([self.terms[term] for term in known], axis=1) / self.tolerance[:, None]
        sizes = np.max(np.abs(columns), axis=0)
        shares, _, rank, singular = np.linalg.lstsq(columns / sizes, self.change / self.tolerance, rcond=1e-15)
        if rank < len(known) or singular[0] > CONDITION_MAX * singular[-1]:
            return None
        coefficients = shares / sizes
        kept = [bool(is_kept) for is_kept in (np.abs(coefficients) > COEFFICIENT_MIN) & (np.abs(shares) > 1)]
        if not all(kept):  # the others carry what little these had
            return self.solve([term for term, is_kept in zip(known, kept, strict=True) if is_kept])
        combination = dict(zip(known, coefficients.tolist(), strict=True))
        return combination if self.explains(combination) else None

    def select_independent(self, terms: Sequence[Term]) -> list[Term]:
        """Returns the terms without those that are zero or equal to an earlier one."""
        independent: list[Term] = []
        for term in terms:
            column = self.terms.get(term)
            if column is not None and np.any(np.abs(column) > self.tolerance):
                same = (np.all(np.abs(column - self.terms[index]) <= self.tolerance) for index in independent)
                if not any(same):
                    independent.append(term)
        return independent


def format_coefficient(value: float) -> str:
    """Returns a coefficient as a fraction if it is a simple one, else as a decimal number."""
    for denominators, tolerance in ((1000, 1e-9), (20_000, 1e-11)):
        near = Fraction(value).limit_denominator(denominators)
        if abs(float(near) - value) <= tolerance * max(1.0, abs(value)):
            return str(near)
    return f"{value:.5g}"
