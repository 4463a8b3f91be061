"""How well a number of runs tells the share of them that succeeds."""

from math import sqrt

Z = 1.959963984540054
"""The 97.5 % quantile of the normal distribution: intervals of 95 %."""


def bound_share(successes: int, runs: int) -> tuple[float, float]:
    """Returns the 95 % interval of a share of successes. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209.

    Raises ValueError unless there are runs, and no more successes than runs."""
    if not 0 <= successes <= runs or not runs:
        raise ValueError(f"{successes} successes in {runs} runs have no share")
    share = successes / runs
    middle = (share + Z**2 / (2 * runs)) / (1 + Z**2 / runs)
    half = Z * sqrt(share * (1 - share) / runs + Z**2 / (4 * runs**2)) / (1 + Z**2 / runs)
    return max(0.0, min(share, middle - half)), min(1.0, max(share, middle + half))
