"""The one-step map linearised at an equilibrium, and its spectral radius: stability for ever, at small amplitude."""

from functools import lru_cache
from typing import Literal

import mujoco
import numpy as np
from mujoco import mjtIntegrator
from numpy.typing import NDArray
from scipy import optimize

from grader.numerics.scene import Scene, Vector
from grader.numerics.workspace import Workspace

Matrix = NDArray[np.float64]

EPS = 1e-6
"""Step of the central differences. Source: cube root of the rounding unit, balancing truncation and rounding."""

RADIUS_NOISE = 1e-7
"""What differencing leaves in a spectral radius of 1; larger is growth."""

REST = 1e-9
"""Accelerations below this count as rest [rad/s2, m/s2], or relative to those at qpos0 where these are larger."""


@lru_cache(maxsize=128)
def equilibrium(scene: Scene) -> Scene | None:
    """The scene at rest where nothing accelerates, sought from qpos0 with the scene's controls; None if not found.

    Sought once per scene.
    """
    # What counts is the residual that is left: the solver calls a root at rounding level "no progress".
    found, residual = _resting(scene, "hybr")
    return found if residual <= REST else None


@lru_cache(maxsize=128)
def calmest(scene: Scene) -> Scene:
    """The equilibrium, or where there is none, as in free fall, the scene at rest where it accelerates least."""
    return equilibrium(scene) or _resting(scene, "lm")[0]


def _resting(scene: Scene, method: Literal["hybr", "lm"]) -> tuple[Scene, float]:
    """The scene at the rest that SciPy's `root` finds, and the acceleration left there, relative as REST is."""
    with scene.borrow() as workspace:
        model, data = workspace.model, workspace.data
        origin, nv = np.array(model.qpos0), int(model.nv)

        def rest(unknowns: Vector) -> Vector:
            data.qpos[:] = origin
            mujoco.mj_integratePos(model, data.qpos, unknowns[:nv], 1.0)
            data.qvel[:] = 0
            data.act[:] = unknowns[nv:]
            mujoco.mj_forward(model, data)
            return np.concatenate([data.qacc, data.act_dot])

        unknowns = np.concatenate([np.zeros(nv), data.act])
        first = residual = float(np.abs(rest(unknowns)).max(initial=0.0))
        if first != 0:
            unknowns = optimize.root(rest, unknowns, method=method, tol=1e-12).x
            residual = float(np.abs(rest(unknowns)).max())
        qpos, act = data.qpos.copy(), data.act.copy()
    return scene.at(qpos=qpos, qvel=np.zeros(nv), act=act), residual / max(1.0, first)


def one_step_map(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> Matrix:
    """d(next state)/d(state) at the scene's start, (2 nv + na) square, positions as tangent vectors.

    `mjd_transitionFD` for the single-step methods, central differences of whole steps for RK4, which it refuses.
    """
    with scene.borrow(timestep_s=timestep_s, integrator=integrator, skip=True) as workspace:
        if int(workspace.option.integrator) == mjtIntegrator.mjINT_RK4:
            return differenced_map(workspace)
        size = 2 * workspace.model.nv + workspace.model.na
        jacobian = np.zeros((size, size))
        mujoco.mjd_transitionFD(workspace.model, workspace.data, EPS, True, jacobian, None, None, None)
        return jacobian


def differenced_map(workspace: Workspace) -> Matrix:
    """The same by central differences of mj_step, for any integrator."""
    model, data = workspace.model, workspace.data
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


def spectrum(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> Vector:
    """|eigenvalues| of the one-step map at the scene's start, largest first; all inf where the map is not finite."""
    jacobian = one_step_map(scene, timestep_s=timestep_s, integrator=integrator)
    if not np.all(np.isfinite(jacobian)):
        return np.full(len(jacobian), np.inf)
    return np.sort(np.abs(np.linalg.eigvals(jacobian)))[::-1]


def spectral_radius(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> float:
    """The largest |eigenvalue| of the one-step map at the scene's start; inf where the map is not finite."""
    return float(np.max(spectrum(scene, timestep_s=timestep_s, integrator=integrator), initial=0.0))
