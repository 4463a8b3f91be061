"""Linearises the one-step map at an equilibrium; its spectral radius decides the stability of small motions."""

from functools import lru_cache
from math import isfinite
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
"""Error of a spectral radius of 1 from finite differences; a radius further above 1 is growth."""

SPECTRAL_POINTS = 64
"""Grid of `find_spectral_limit`; the spectral radius is assumed to pass 1 at most once within a cell."""

REST = 1e-9
"""Accelerations below this count as rest [rad/s2, m/s2]; relative to those at qpos0 if these exceed 1."""


@lru_cache(maxsize=128)
def find_equilibrium(scene: Scene) -> Scene | None:
    """Find the scene's equilibrium, starting at qpos0, with the scene's controls; None if there is none. The result is
    cached per scene."""
    # The residual decides, not the solver's status, which is "no progress" for a root at rounding level.
    resting, residual = _find_rest(scene, "hybr")
    return resting if residual <= REST else None


@lru_cache(maxsize=128)
def find_least_accelerated(scene: Scene) -> Scene:
    """Find the equilibrium or, if there is none, as in free fall, the position at rest with the least acceleration."""
    return find_equilibrium(scene) or _find_rest(scene, "lm")[0]


def _find_rest(scene: Scene, method: Literal["hybr", "lm"]) -> tuple[Scene, float]:
    """Returns the scene at rest where SciPy's `root` ends, and the remaining acceleration, scaled as for REST."""
    with scene.borrow() as workspace:
        model, data = workspace.model, workspace.data
        origin, nv = np.array(model.qpos0), int(model.nv)

        def compute_accelerations(unknowns: Vector) -> Vector:
            data.qpos[:] = origin
            mujoco.mj_integratePos(model, data.qpos, unknowns[:nv], 1.0)
            data.qvel[:] = 0
            data.act[:] = unknowns[nv:]
            mujoco.mj_forward(model, data)
            return np.concatenate([data.qacc, data.act_dot])

        unknowns = np.concatenate([np.zeros(nv), data.act])
        first = residual = float(np.abs(compute_accelerations(unknowns)).max(initial=0.0))
        if first != 0:
            unknowns = optimize.root(compute_accelerations, unknowns, method=method, tol=1e-12).x
            residual = float(np.abs(compute_accelerations(unknowns)).max())
        qpos, act = data.qpos.copy(), data.act.copy()
    return scene.at(qpos=qpos, qvel=np.zeros(nv), act=act), residual / max(1.0, first)


def linearise_step(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> Matrix:
    """d(next state)/d(state) at the scene's start, (2 nv + na, 2 nv + na), positions as tangent vectors. Uses
    `mjd_transitionFD`, or central differences of whole steps for RK4, which it does not support."""
    with scene.borrow(timestep_s=timestep_s, integrator=integrator, skip=True) as workspace:
        if int(workspace.option.integrator) == mjtIntegrator.mjINT_RK4:
            return difference_step(workspace)
        size = 2 * workspace.model.nv + workspace.model.na
        jacobian = np.zeros((size, size))
        mujoco.mjd_transitionFD(workspace.model, workspace.data, EPS, True, jacobian, None, None, None)
        return jacobian


def difference_step(workspace: Workspace) -> Matrix:
    """`linearise_step` by central differences of mj_step, for any integrator, at the state of the workspace."""
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


def compute_spectrum(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> Vector:
    """|eigenvalues| of the one-step map at the scene's start, largest first; all inf if the map is not finite."""
    jacobian = linearise_step(scene, timestep_s=timestep_s, integrator=integrator)
    if not np.all(np.isfinite(jacobian)):
        return np.full(len(jacobian), np.inf)
    return np.sort(np.abs(np.linalg.eigvals(jacobian)))[::-1]


def compute_spectral_radius(scene: Scene, *, timestep_s: float | None = None, integrator: int | None = None) -> float:
    """Returns the largest |eigenvalue| of the one-step map at the scene's start; inf if the map is not finite."""
    return float(np.max(compute_spectrum(scene, timestep_s=timestep_s, integrator=integrator), initial=0.0))


def find_spectral_limit(
    scene: Scene, *, low_s: float, high_s: float, integrator: int | None = None, width_s: float = 1e-9
) -> float | None:
    """The linear stability limit [s]: the lowest timestep at which the spectral radius at the equilibrium passes 1.
    Returns None if it does not pass 1 between `low_s` and `high_s`, and `low_s` if it exceeds 1 there. Raises
    ValueError if there is no equilibrium, or the range is empty."""
    if not (isfinite(high_s) and 0 < low_s < high_s and width_s > 0):
        raise ValueError(f"cannot search between {low_s} and {high_s} s to {width_s} s")
    resting = find_equilibrium(scene)
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
    while high_s - low_s > width_s:
        middle = 0.5 * (low_s + high_s)
        low_s, high_s = (low_s, middle) if is_unstable(middle) else (middle, high_s)
    return 0.5 * (low_s + high_s)
