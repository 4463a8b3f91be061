"""Finds equilibria: positions at rest without acceleration, and the one at which a motion comes to rest."""

from functools import lru_cache
from math import isfinite
from typing import Literal

import mujoco
import numpy as np
from mujoco import mjtIntegrator
from numpy.typing import NDArray

from grader.numerics.scene import Scene, Vector
from grader.numerics.stability.linear import EPS

REST = 1e-9
"""Accelerations below this count as rest [rad/s2, m/s2]; relative to those at qpos0 if these exceed 1."""

UNSTABLE_RATE = 1e-3
"""Growth rate of the exact motion, relative to the fastest rate, above which an equilibrium is unstable."""

RELAXATIONS = 400
"""Most steps of the overdamped motion to a stable equilibrium."""

APART = 1e-3
"""Positions that are farther apart are two equilibria [rad, m]."""

GAIN, FARTHEST, AT_REST = 0.5, 0.05, 1e-6
"""Step of the overdamped motion over its stability limit, its longest step, and the one at which it ends [rad, m]."""


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


def compute_rates(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.complex128]:
    """Returns the eigenvalues [1/s] of the equations of motion at the state of `data`; all inf if these are not finite.
    An activation that is held at its limit has none: it does not move.

    Central differences of accelerations and activation rates, 4 nv + 2 na evaluations that write into `data`.
    """
    nv, na = int(model.nv), int(model.na)
    held = 2 * nv + find_held_activations(model, data)
    qpos, qvel, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def compute_rate(nudge: Vector) -> Vector:
        data.qpos[:], data.qvel[:], data.act[:] = qpos, qvel + nudge[nv : 2 * nv], act + nudge[2 * nv :]
        mujoco.mj_integratePos(model, data.qpos, nudge[:nv], 1.0)
        mujoco.mj_forward(model, data)
        return np.concatenate([data.qacc, data.act_dot])

    size = 2 * nv + na
    jacobian = np.zeros((size, size))
    jacobian[:nv, nv : 2 * nv] = np.eye(nv)
    for column, nudge in enumerate(EPS * np.eye(size)):
        jacobian[nv:, column] = (compute_rate(nudge) - compute_rate(-nudge)) / (2 * EPS)
    if not np.all(np.isfinite(jacobian)):
        return np.full(size, np.inf, dtype=np.complex128)
    moving = np.delete(np.delete(jacobian, held, axis=0), held, axis=1)
    return np.asarray(np.linalg.eigvals(moving), dtype=np.complex128)


def find_held_activations(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.int64]:
    """Returns the places in act of those at a limit that their rate does not lead away from."""
    limited = np.flatnonzero(model.actuator_actlimited)
    if not len(limited):
        return limited
    mujoco.mj_forward(model, data)
    at = model.actuator_actadr[limited] + model.actuator_actnum[limited] - 1
    low, high = model.actuator_actrange[limited].T
    act, rate = data.act[at], data.act_dot[at]
    return np.asarray(at[((act >= high) & (rate >= 0)) | ((act <= low) & (rate <= 0))], dtype=np.int64)


@lru_cache(maxsize=128)
def find_equilibrium_of_motion(scene: Scene) -> Scene | None:
    """Find the equilibrium at which damping would bring the motion from the scene's start to rest; None if none exists.

    It is the one near qpos0 unless that is unstable in the exact motion, as of a pendulum that is defined upright, or
    the overdamped motion from the start comes to rest APART from it, as in the other well of a toggle.
    """
    near = find_equilibrium(scene)
    if near is None or scene.model.nv == 0:
        return near
    if np.array_equal(scene.start.qpos, scene.model.qpos0) and not _is_unstable(near):
        return near
    relaxed, residual = _find_rest(scene, "hybr", _relax(scene))
    if residual > REST or _is_unstable(relaxed):
        return near
    return relaxed if _is_unstable(near) or _measure_distance(near, relaxed) > APART else near


def _measure_distance(one: Scene, other: Scene) -> float:
    """Returns the largest coordinate of the way between two positions [rad, m]."""
    way = np.zeros(one.model.nv)
    mujoco.mj_differentiatePos(one.model, way, 1.0, np.array(one.start.qpos), np.array(other.start.qpos))
    return float(np.abs(way).max())


def _is_unstable(resting: Scene) -> bool:
    """Whether small motions about a scene at rest grow in the exact motion."""
    with resting.borrow(integrator=int(mjtIntegrator.mjINT_EULER)) as workspace:
        rates = compute_rates(workspace.model, workspace.data)
    return float(rates.real.max(initial=0.0)) > UNSTABLE_RATE * (1 + float(np.abs(rates).max(initial=0.0)))


def _relax(scene: Scene) -> Vector:
    """Returns the position at which the overdamped motion from the scene's start ends."""
    with scene.borrow(integrator=int(mjtIntegrator.mjINT_EULER)) as workspace:
        model, data = workspace.model, workspace.data
        start = data.qpos.copy()
        data.qvel[:] = 0
        stiffness = float(np.abs(compute_rates(model, data)).max(initial=0.0)) ** 2
        data.qpos[:] = start
        for _ in range(RELAXATIONS if isfinite(stiffness) else 0):
            data.qvel[:] = 0
            mujoco.mj_forward(model, data)
            step = GAIN / max(stiffness, 1.0) * data.qacc
            largest = float(np.abs(step).max(initial=0.0))
            if largest < AT_REST:
                break
            mujoco.mj_integratePos(model, data.qpos, step * min(1.0, FARTHEST / largest), 1.0)
        return np.array(data.qpos)


def _find_rest(scene: Scene, method: Literal["hybr", "lm"], origin: Vector | None = None) -> tuple[Scene, float]:
    """Returns the scene at rest where SciPy's `root` ends, from `origin` or else qpos0, and the remaining acceleration,
    scaled as for REST."""
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
            from scipy import optimize  # SciPy takes half of the time that the grader takes to start

            unknowns = optimize.root(compute_accelerations, unknowns, method=method, tol=1e-12).x
            residual = float(np.abs(compute_accelerations(unknowns)).max())
        qpos, act = data.qpos.copy(), data.act.copy()
    return scene.at(qpos=qpos, qvel=np.zeros(nv), act=act), residual / max(1.0, first)
