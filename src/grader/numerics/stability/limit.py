"""Finds the linear stability limit: the timestep at which the spectral radius at the equilibrium passes 1."""

from math import isfinite

import numpy as np

from grader.numerics.scene import Scene
from grader.numerics.stability.equilibrium import find_equilibrium_of_motion
from grader.numerics.stability.linear import RADIUS_NOISE, compute_spectral_radius

SPECTRAL_POINTS = 64
"""Grid of `find_spectral_limit`; the spectral radius is assumed to pass 1 at most once within a cell."""

RELATIVE_WIDTH = 1e-6
"""Width to which a limit is sought relative to its size, where that is less than what the caller allows."""


def find_spectral_limit(
    scene: Scene, *, low_s: float, high_s: float, integrator: int | None = None, width_s: float = 1e-9
) -> float | None:
    """The linear stability limit [s]: the lowest timestep at which the spectral radius at the equilibrium passes 1.
    Returns None if it does not pass 1 between `low_s` and `high_s`, and `low_s` if it exceeds 1 there. Raises
    ValueError if there is no equilibrium, or the range is empty."""
    if not (isfinite(high_s) and 0 < low_s < high_s and width_s > 0):
        raise ValueError(f"cannot search between {low_s} and {high_s} s to {width_s} s")
    resting = find_equilibrium_of_motion(scene)
    if resting is None:
        raise ValueError("no equilibrium was found to linearise at")

    def is_unstable(timestep_s: float) -> bool:
        return compute_spectral_radius(resting, timestep_s=timestep_s, integrator=integrator) > 1 + RADIUS_NOISE

    grid = np.linspace(low_s, high_s, SPECTRAL_POINTS + 1).tolist()
    first = next((i for i, h in enumerate(grid) if is_unstable(h)), None)
    if first is None:
        return None
    if first == 0:
        return low_s
    low_s, high_s = grid[first - 1], grid[first]
    width_s = min(width_s, RELATIVE_WIDTH * high_s)
    while high_s - low_s > width_s:
        middle = 0.5 * (low_s + high_s)
        low_s, high_s = (low_s, middle) if is_unstable(middle) else (middle, high_s)
    return 0.5 * (low_s + high_s)
