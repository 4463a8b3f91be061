"""Tells a motion that only the timestep keeps up: it lasts to the end of a run, and at a shorter timestep dies away."""

from collections.abc import Callable

import numpy as np

from grader.experiments.quantities import Floats
from grader.experiments.regime import STEPS_MAX
from grader.experiments.runs import SAME, LabRun, Variant

SHORTER = 8
"""How many times shorter the timestep is at which the motion should last as well."""

PARTS = 5
"""Parts of a run, of which the last two tell whether the motion lasts."""

LASTS = 0.5
"""The share of the motion in the part before that the last part has, at least, where the motion lasts."""

VISIBLE = 0.01
"""The share of the largest motion that the last part has, at least, where there is any."""

DIES = 0.1
"""The largest share of it that is left at the shorter timestep, where the motion dies away."""


def explain_lasting_motion(read: Callable[[Variant], tuple[LabRun, Floats]]) -> str | None:
    """Says that velocities (nv, n) which `read` returns with a run, one a step, last to its end in a degree of freedom,
    and at a shorter timestep do not. None where they die away, last at both, or the run has too many steps to tell.
    Raises as `read` does."""
    run, velocities = read(SAME)
    shorter = min(SHORTER, STEPS_MAX // max(run.steps, 1))
    *_, before, last = measure_parts(velocities)
    lasting = (last >= LASTS * before) & (last > VISIBLE * np.abs(velocities).max())
    if shorter < 2 or not lasting.any():
        return None
    finer = measure_parts(read(Variant(finer=shorter))[1])[-1]
    kept_up = np.flatnonzero(lasting & (finer <= DIES * last))
    if not len(kept_up):
        return None
    dof = int(kept_up[np.argmax(last[kept_up])])
    return (
        f"the motion in degree of freedom {dof} lasts to the end of the run, where its velocity is {last[dof]:.3g}, "
        f"and dies away at a timestep {shorter} times shorter, to {finer[dof]:.3g}"
    )


def measure_parts(velocities: Floats) -> Floats:
    """Returns the root of the mean square (PARTS, nv) in each part of a series (nv, n)."""
    parts = np.array_split(velocities, PARTS, axis=1)
    return np.array([np.sqrt(np.mean(part**2, axis=1)) for part in parts])
