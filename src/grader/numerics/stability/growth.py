"""Detects linear growth behind a run that neither warned nor came to rest. A soft servo under gravity has it: beyond
its linear stability limit gravity bounds the motion, and MuJoCo never warns."""

from dataclasses import dataclass
from math import log

import mujoco
import numpy as np
from mujoco import mjMAXVAL

from grader.numerics.scene import Scene, Vector
from grader.numerics.stability.equilibrium import find_equilibrium_of_motion, find_least_accelerated
from grader.numerics.stability.linear import RADIUS_NOISE, compute_spectrum

CLEAR_GROWTH = 1.05
"""Spectral radius above which a run without a warning may be called unstable. Source: the lesson's servo between its
linear stability limit, 19.983 ms, and its limit within 300 s, 20.009 ms, has a spectral radius below 1.01 and counts as
stable."""

CERTAINTY = 2.0
"""Factor, in the logarithm of growth, by which numerical growth must exceed what would raise a warning within the run,
and the growth of the exact motion."""

REFINEMENT = 256
"""The growth of the exact motion is measured with steps this many times shorter. RADIUS_NOISE then amounts to less than
1e-4 of growth per whole step."""

RESOLVED = 1.02
"""Growth per short step above which the short step is too long too: it would be 150 per whole step."""


@dataclass(frozen=True)
class Growth:
    """Whether a run has numerical growth that nonlinear forces bounded, and a clause that says so."""

    bounded: bool
    clause: str = ""


def measure_growth(scene: Scene, *, timestep_s: float, integrator: int, steps: int, motion: float) -> Growth:
    """Measure the growth of small motions about the scene's equilibrium over `steps`, from `motion` [rad/s2, m/s2].
    Does not count growth that could not have raised a warning within these steps, nor that of an equilibrium which is
    unstable in the exact motion. Raises mujoco.FatalError for a model that MuJoCo cannot linearise."""
    resting = find_least_accelerated(scene)
    moduli = compute_spectrum(resting, timestep_s=timestep_s, integrator=integrator)
    radius = float(moduli[0])
    if radius <= 1 + RADIUS_NOISE:
        return Growth(False)
    clause = f", but small motions grow {radius:.6g} times a step"
    if not _is_noticeable(radius, steps, motion):
        return Growth(False, clause)
    exact = _compute_exact_growth(resting, timestep_s, integrator)
    numerical = moduli[_compute_logs(moduli) > CERTAINTY * exact].max(initial=0.0)
    if not _is_noticeable(float(numerical), steps, motion):
        return Growth(False, f"{clause}, as in the exact motion")
    return Growth(True, f"{clause}: large ones are bounded")


def _is_noticeable(factor: float, steps: int, motion: float) -> bool:
    """Whether growth by `factor` per step is certain, and more than enough for a warning within `steps`."""
    return factor > CLEAR_GROWTH and steps * log(factor) > CERTAINTY * log(max(mjMAXVAL / motion, 1.0))


def _compute_exact_growth(resting: Scene, timestep_s: float, integrator: int) -> Vector:
    """Logarithm of the growth of each mode per timestep, largest first; 0 for decay, or if it cannot be measured."""
    fine = compute_spectrum(resting, timestep_s=timestep_s / REFINEMENT, integrator=integrator)
    return np.zeros(len(fine)) if fine[0] > RESOLVED else np.maximum(REFINEMENT * _compute_logs(fine), 0.0)


def _compute_logs(moduli: Vector) -> Vector:
    return np.log(np.maximum(moduli, np.finfo(float).tiny))


def measure_silent_growth(scene: Scene, *, timestep_s: float, integrator: int) -> float | None:
    """Returns the growth per step of small motions about the equilibrium of the motion that the exact motion lacks; 1
    where nothing grows.

    None without an equilibrium, where contacts or limits act in it, as these push one way only, or where MuJoCo cannot
    linearise the model.
    """
    try:
        resting = find_equilibrium_of_motion(scene)
        if resting is None or scene.model.nv == 0 or _is_touching(resting):
            return None
        moduli = compute_spectrum(resting, timestep_s=timestep_s, integrator=integrator)
        if not moduli[0] > 1 + RADIUS_NOISE:
            return 1.0
        exact = _compute_exact_growth(resting, timestep_s, integrator)
    except mujoco.FatalError:
        return None
    return float(moduli[_compute_logs(moduli) > CERTAINTY * exact].max(initial=1.0))


def _is_touching(resting: Scene) -> bool:
    """Whether a contact, a limit or friction acts."""
    with resting.borrow() as workspace:
        mujoco.mj_forward(workspace.model, workspace.data)
        return int(workspace.data.nefc) > int(workspace.data.ne)
