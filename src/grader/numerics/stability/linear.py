"""Linearises the one-step map at an equilibrium; its spectral radius decides the stability of small motions."""

import mujoco
import numpy as np
from mujoco import mjtIntegrator
from numpy.typing import NDArray

from grader.numerics.scene import FULL_STATE, Scene, Vector

Matrix = NDArray[np.float64]

EPS = 1e-6
"""Step of the central differences. Source: cube root of the rounding unit, balancing truncation and rounding."""

RADIUS_NOISE = 1e-7
"""Error of a spectral radius of 1 from finite differences; a radius further above 1 is growth."""


def linearise_step(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> Matrix:
    """d(next state)/d(state) at the scene's start, (2 nv + na, 2 nv + na), positions as tangent vectors. Uses
    `mjd_transitionFD`, or central differences of whole steps for RK4, which it does not support."""
    with scene.borrow(timestep_s=timestep_s, integrator=integrator, skip=True) as workspace:
        return _linearise(workspace.model, workspace.data)


def _linearise(model: mujoco.MjModel, data: mujoco.MjData) -> Matrix:
    if int(model.opt.integrator) == mjtIntegrator.mjINT_RK4:
        return difference_step(model, data)
    size = 2 * model.nv + model.na
    jacobian = np.zeros((size, size))
    mujoco.mjd_transitionFD(model, data, EPS, True, jacobian, None, None, None)
    return jacobian


def compute_growth_rates(model: mujoco.MjModel, data: mujoco.MjData, state: Vector, timestep_s: float) -> Vector:
    """Returns log|mu|/h [1/s] of every mode of the one-step map at a full state; all inf if the map is not finite.

    Writes `data`; the timestep of `model` is as before.
    """
    mujoco.mj_setState(model, data, state, FULL_STATE)
    own, model.opt.timestep = float(model.opt.timestep), timestep_s
    try:
        moduli = _compute_moduli(_linearise(model, data))
    finally:
        model.opt.timestep = own
    return np.asarray(np.log(np.maximum(moduli, np.finfo(float).tiny)) / timestep_s)


def difference_step(model: mujoco.MjModel, data: mujoco.MjData) -> Matrix:
    """Returns the same matrix by central differences of mj_step, for any integrator, at the state of `data`."""
    nv, size = int(model.nv), int(2 * model.nv + model.na)
    start = (data.qpos.copy(), data.qvel.copy(), data.act.copy(), float(data.time), data.qacc_warmstart.copy())

    def step(nudge: Vector) -> tuple[Vector, Vector]:
        data.qpos[:], data.qvel[:], data.act[:] = start[:3]
        data.time, data.qacc_warmstart[:] = start[3:]
        mujoco.mj_integratePos(model, data.qpos, nudge[:nv], 1.0)
        data.qvel[:] += nudge[nv : 2 * nv]
        data.act[:] += nudge[2 * nv :]
        mujoco.mj_step(model, data)
        return data.qpos.copy(), np.concatenate([data.qvel, data.act])

    jacobian = np.empty((size, size))
    for column, nudge in enumerate(EPS * np.eye(size)):
        (qpos_low, rest_low), (qpos_high, rest_high) = step(-nudge), step(nudge)
        dpos = np.empty(nv)
        mujoco.mj_differentiatePos(model, dpos, 2 * EPS, qpos_low, qpos_high)
        jacobian[:nv, column] = dpos
        jacobian[nv:, column] = (rest_high - rest_low) / (2 * EPS)
    return jacobian


def _compute_moduli(jacobian: Matrix) -> Vector:
    if not np.all(np.isfinite(jacobian)):
        return np.full(len(jacobian), np.inf)
    return np.sort(np.abs(np.linalg.eigvals(jacobian)))[::-1]


def compute_spectrum(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> Vector:
    """|eigenvalues| of the one-step map at the scene's start, largest first; all inf if the map is not finite."""
    return _compute_moduli(linearise_step(scene, timestep_s=timestep_s, integrator=integrator))


def compute_spectral_radius(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> float:
    """Returns the largest |eigenvalue| of the one-step map at the scene's start; inf if the map is not finite."""
    return float(np.max(compute_spectrum(scene, timestep_s=timestep_s, integrator=integrator), initial=0.0))
