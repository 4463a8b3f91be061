"""A second look at a run that neither warned nor came to rest: do small motions grow, so that something bounds them?

A soft servo under gravity does that: beyond its limit it whirls about for ever, and MuJoCo never warns.
"""

from dataclasses import dataclass
from math import log

import numpy as np
from mujoco import mjMAXVAL

from grader.numerics.linear import RADIUS_NOISE, calmest, spectrum
from grader.numerics.scene import Scene, Vector

CLEAR_GROWTH = 1.05
"""Growth a step above which a run without a warning is not called stable. Source: the lesson's servo, which gravity
bounds between 19.983 and 20.009 ms, grows by less than 1.01 there and is stable by the criterion."""

CLEARLY = 2.0
"""And only where linear growth was this many times enough to be noticed in time, on a log scale; and this many times
as fast as in truth."""

FINER = 256
"""The truth is taken at this fraction of the timestep: RADIUS_NOISE is then less than 1e-4 of growth a whole step."""

RESOLVED = 1.02
"""Growth in such a fraction above which that is too long too, and the truth unknown: it would be 150 a whole step."""


@dataclass(frozen=True)
class Look:
    """Is there growth that only something bounded, and what to say of it after "no warning"."""

    bounded: bool
    words: str = ""


def growth_at_rest(scene: Scene, *, timestep_s: float, integrator: int, steps: int, motion: float) -> Look:
    """Look at small motions about the scene's equilibrium over `steps`, from a first `motion` [rad/s2, m/s2].

    Growth that MuJoCo could not have noticed within these steps is no contradiction, nor is that of an equilibrium
    which is unstable in truth. Raises mujoco.FatalError for a model that MuJoCo cannot linearise.
    """
    resting = calmest(scene)
    moduli = spectrum(resting, timestep_s=timestep_s, integrator=integrator)
    radius = float(moduli[0])
    if radius <= 1 + RADIUS_NOISE:
        return Look(False)
    words = f", but small motions grow {radius:.6g} times a step"
    if not _noticeable(radius, steps, motion):
        return Look(False, words)
    false = moduli[_logs(moduli) > CLEARLY * _true_growth(resting, timestep_s, integrator)].max(initial=0.0)
    if not _noticeable(float(false), steps, motion):
        return Look(False, f"{words}, as they do in truth")
    return Look(True, f"{words}: large ones are bounded")


def _noticeable(factor: float, steps: int, motion: float) -> bool:
    """Is growth by `factor` a step clear, and was it more than enough for a warning within `steps`?"""
    return factor > CLEAR_GROWTH and steps * log(factor) > CLEARLY * log(max(mjMAXVAL / motion, 1.0))


def _true_growth(resting: Scene, timestep_s: float, integrator: int) -> Vector:
    """Logarithm of growth within a timestep, of each mode in order, largest first; 0 where it decays or is unknown."""
    fine = spectrum(resting, timestep_s=timestep_s / FINER, integrator=integrator)
    return np.zeros(len(fine)) if fine[0] > RESOLVED else np.maximum(FINER * _logs(fine), 0.0)


def _logs(moduli: Vector) -> Vector:
    return np.log(np.maximum(moduli, np.finfo(float).tiny))
