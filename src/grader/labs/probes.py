"""Linearises the motion of a lab while it runs, for certificates: are its timesteps short enough?"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.numerics.scene import FULL_STATE, Vector
from grader.numerics.stability.equilibrium import compute_rates
from grader.numerics.stability.linear import compute_growth_rates

UNBOUNDED = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
"""Geoms that nothing flies through: they have no other side."""

BALLS = (int(mujoco.mjtGeom.mjGEOM_SPHERE), *UNBOUNDED)
ROUND = (int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_CYLINDER))
"""Geoms with the same place after any turn, and after a turn about their own z axis."""


@dataclass(frozen=True)
class Probe:
    """The equations of motion at one state of a run.

    `rates` are their eigenvalues [1/s], `crossing` how often a second the fastest geom covers half the thinnest that
    may collide [1/s]; `compute_growth_rates` gives the growth [1/s] of each mode at a timestep [s].
    """

    rates: NDArray[np.complex128]
    crossing: float
    compute_growth_rates: Callable[[float], Vector]


def probe_motion(model: mujoco.MjModel, data: mujoco.MjData) -> Probe:
    """Linearise the motion at the state of `data`, which stays as it is."""
    state = np.empty(mujoco.mj_stateSize(model, FULL_STATE))
    mujoco.mj_getState(model, data, state, FULL_STATE)
    scratch = mujoco.MjData(model)
    mujoco.mj_setState(model, scratch, state, FULL_STATE)
    # Under `discrete`, qacc would hold a difference quotient over one step: accelerations are read under Euler.
    integrator, model.opt.integrator = model.opt.integrator, int(mujoco.mjtIntegrator.mjINT_EULER)
    try:
        rates = compute_rates(model, scratch)
    finally:
        model.opt.integrator = integrator
    mujoco.mj_setState(model, scratch, state, FULL_STATE)
    crossing = compute_crossing_rate(model, scratch)
    return Probe(rates, crossing, partial(compute_growth_rates, model, scratch, state))


def compute_crossing_rate(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Returns the highest speed of a geom over the thinnest half extent of those that may collide [1/s]."""
    colliding = np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    colliding = np.union1d(colliding, np.concatenate([model.pair_geom1, model.pair_geom2]))
    thickness = model.geom_aabb[colliding, 3:].min(axis=1)[~np.isin(model.geom_type[colliding], UNBOUNDED)]
    if len(colliding) < 2 or not len(thickness) or not thickness.min() > 0:
        return 0.0
    mujoco.mj_forward(model, data)
    velocity, fastest = np.zeros(6), 0.0
    for geom in colliding.tolist():
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, velocity, 1)
        swept = compute_swept_speed(int(model.geom_type[geom]), float(model.geom_rbound[geom]), velocity[:3])
        fastest = max(fastest, float(np.linalg.norm(velocity[3:])) + swept)
    return fastest / float(thickness.min())


def compute_swept_speed(shape: int, reach: float, turning: Vector) -> float:
    """Returns the speed [m/s] at which a geom that turns in its own frame, `turning` (3,) [rad/s], sweeps through space
    beside its centre, at most `reach` [m] from it. A ball sweeps none, and what is round none about its axis."""
    if shape in BALLS:
        return 0.0
    return reach * float(np.linalg.norm(turning[:2] if shape in ROUND else turning))
