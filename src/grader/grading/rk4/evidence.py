"""Pictures of a judged step: the difference against time, and the error against the timestep with slopes."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grader.grading.rk4.outcomes import OrderOutcome, Outcome

POINTS_MAX = 300


def evidence_of(outcomes: Sequence[Outcome], order: OrderOutcome | None) -> dict[str, Any]:
    """`differences` of visible cases (for a logarithmic axis), and `order`."""
    return {
        "differences": [difference_picture(outcome) for outcome in outcomes if not outcome.case.hidden],
        "order": order_picture(order),
    }


def difference_picture(outcome: Outcome) -> dict[str, Any]:
    """Time [s] and the size of the differences in position and velocity."""
    rows = len(outcome.difference.qpos)
    chosen = (
        np.unique(np.linspace(0, rows - 1, min(rows, POINTS_MAX)).round().astype(int)) if rows else np.array([], int)
    )
    return {
        "case": outcome.case.id,
        "tolerance": outcome.case.tolerance,
        "time_s": figures((chosen + 1) * outcome.run.timestep_s),
        "qpos": figures(outcome.difference.qpos[chosen]),
        "qvel": figures(outcome.difference.qvel[chosen]),
    }


def order_picture(order: OrderOutcome | None) -> dict[str, Any] | None:
    """Timesteps [ms], errors against the exact motion, their slope; null where a run ended early."""
    if order is None:
        return None
    return {
        "timestep_ms": [1000 * h for h in order.check.timesteps_s],
        "error": [float(f"{error:.4g}") if isfinite(error) else None for error in order.errors],
        "slope": None if order.slope is None else round(order.slope, 3),
        "expected_slope": 4,
    }


def figures(values: NDArray[np.float64]) -> list[float | None]:
    """To four figures; None for what is not finite."""
    return [float(f"{value:.4g}") if isfinite(value) else None for value in values.tolist()]
