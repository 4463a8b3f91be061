"""Linearises the one-step map at an equilibrium; its spectral radius decides the stability of small motions."""

from functools import lru_cache
from math import isfinite
from typing import Literal

import mujoco
import numpy as np
from mujoco import mjtIntegrator
from numpy.typing import NDArray
from scipy import optimize

from grader.numerics.scene import FULL_STATE, Scene, Vector
from grader.numerics.workspace import Workspace

Matrix = NDArray[np.float64]

EPS = 1e-6
"""Step of the central differences. Source: cube root of the rounding unit, balancing truncation and rounding."""

RADIUS_NOISE = 1e-7
"""Error of a spectral radius of 1 from finite differences; a radius further above 1 is growth."""

SPECTRAL_POINTS = 64
"""Grid of `find_spectral_limit`; the spectral radius is assumed to pass 1 at most once within a cell."""

RELATIVE_WIDTH = 1e-6
"""Width to which a limit is sought relative to its size, where that is less than what the caller allows."""

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


UNSTABLE_RATE = 1e-3
"""Growth rate of the exact motion, relative to the fastest rate, above which an equilibrium is unstable."""

RELAXATIONS = 400
"""Most steps of the overdamped motion to a stable equilibrium."""


def compute_rates(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.complex128]:
    """Eigenvalues [1/s] of the equations of motion, linearised at the state of `data`, which is written.

    Forward differences of the accelerations and activation rates: 2 nv + na + 1 evaluations.
    """
    nv, na = int(model.nv), int(model.na)
    qpos, qvel, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def rate(column: int, nudge: float) -> Vector:
        data.qpos[:], data.qvel[:], data.act[:] = qpos, qvel, act
        if column < nv:
            step = np.zeros(nv)
            step[column] = nudge
            mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        elif column < 2 * nv:
            data.qvel[column - nv] += nudge
        else:
            data.act[column - 2 * nv] += nudge
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qacc, data.act_dot])

    size = 2 * nv + na
    jacobian = np.zeros((size, size))
    jacobian[:nv, nv : 2 * nv] = np.eye(nv)
    for column in range(size):
        jacobian[nv:, column] = (rate(column, EPS) - rate(column, -EPS)) / (2 * EPS)
    data.qpos[:], data.qvel[:], data.act[:] = qpos, qvel, act
    if not np.all(np.isfinite(jacobian)):
        return np.full(size, np.inf, dtype=np.complex128)
    return np.asarray(np.linalg.eigvals(jacobian), dtype=np.complex128)


SOLID = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))


def compute_crossing_rate(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """How many times a second [1/s] the fastest geom flies through the thinnest that may collide, by half extents."""
    colliding = np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    thick = model.geom_aabb[colliding, 3:].min(axis=1)[~np.isin(model.geom_type[colliding], SOLID)]
    if len(colliding) < 2 or not len(thick) or not thick.min() > 0:
        return 0.0
    mujoco.mj_forward(model, data)
    velocity, fastest = np.zeros(6), 0.0
    for geom in colliding.tolist():
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, velocity, 0)
        fastest = max(fastest, float(np.linalg.norm(velocity[3:])))
    return fastest / float(thick.min())


def compute_decays(model: mujoco.MjModel, data: mujoco.MjData, state: Vector, timestep_s: float) -> Vector:
    """Growth rates [1/s] of all modes in the discretised motion at a full state; `data` and the timestep are written."""
    mujoco.mj_setState(model, data, state, FULL_STATE)
    own, model.opt.timestep = float(model.opt.timestep), timestep_s
    try:
        if int(model.opt.integrator) == mjtIntegrator.mjINT_RK4:
            jacobian = _differenced(model, data)
        else:
            size = 2 * model.nv + model.na
            jacobian = np.zeros((size, size))
            mujoco.mjd_transitionFD(model, data, EPS, True, jacobian, None, None, None)
    finally:
        model.opt.timestep = own
    if not np.all(np.isfinite(jacobian)):
        return np.full(len(jacobian), np.inf)
    moduli = np.maximum(np.abs(np.linalg.eigvals(jacobian)), np.finfo(float).tiny)
    return np.asarray(np.log(moduli) / timestep_s)


def _is_falling(scene: Scene) -> bool:
    """Whether small motions about a scene at rest grow in the exact motion."""
    with scene.borrow(integrator=int(mjtIntegrator.mjINT_EULER)) as workspace:
        found = compute_rates(workspace.model, workspace.data)
    return float(found.real.max(initial=0.0)) > UNSTABLE_RATE * (1 + float(np.abs(found).max(initial=0.0)))


@lru_cache(maxsize=128)
def find_equilibrium_of_motion(scene: Scene) -> Scene | None:
    """The equilibrium about which a motion from the scene's start comes to rest, if anything slows it down.

    That is the one from qpos0, unless it is unstable in the exact motion: then where the overdamped motion from the
    start ends, if that is stable. None if there is no equilibrium at all.
    """
    found = find_equilibrium(scene)
    if found is None or scene.model.nv == 0 or not _is_falling(found):
        return found
    with scene.borrow() as workspace:
        model, data = workspace.model, workspace.data
        data.qvel[:] = 0
        mujoco.mj_forward(model, data)
        stiffness = float(np.abs(compute_rates(model, data)).max(initial=0.0)) ** 2
        if not isfinite(stiffness):
            return found
        gain = 0.5 / max(stiffness, 1.0)
        for _ in range(RELAXATIONS):
            data.qvel[:] = 0
            mujoco.mj_forward(model, data)
            step = gain * data.qacc
            largest = float(np.abs(step).max(initial=0.0))
            if largest < 1e-6:
                break
            mujoco.mj_integratePos(model, data.qpos, step * min(1.0, 0.05 / largest), 1.0)
        origin = data.qpos.copy()
    relaxed, residual = _find_rest(scene, "hybr", origin)
    return relaxed if residual <= REST and not _is_falling(relaxed) else found


def _find_rest(scene: Scene, method: Literal["hybr", "lm"], origin: Vector | None = None) -> tuple[Scene, float]:
    """The scene at rest where SciPy's `root` ends, and the remaining acceleration, scaled as for REST."""
    with scene.borrow() as workspace:
        model, data = workspace.model, workspace.data
        origin, nv = np.array(model.qpos0) if origin is None else origin, int(model.nv)

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
    """`one_step_map` by central differences of mj_step, for any integrator, at the state of the workspace."""
    return _differenced(workspace.model, workspace.data)


def _differenced(model: mujoco.MjModel, data: mujoco.MjData) -> Matrix:
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
