"""Reference solutions: DOP853 on a model's own equations through mj_forward, and Richardson's estimate."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, log2

import mujoco
import numpy as np
from mujoco import mjtIntegrator, mjtJoint
from numpy.typing import NDArray
from scipy import integrate

from grader.numerics.rk4 import PLAIN_DYNAMICS, Forward
from grader.numerics.scene import Scene, Values, Vector, frozen
from grader.numerics.workspace import Workspace

RTOL = 3e-14
"""Source: measured on the double pendulum; reaches 9e-15 over 1 s. SciPy refuses less than 100 rounding units."""

ATOL = 1e-15

TIMESTEP_S = 1e-15
"""What the model takes for its own timestep: an actuator with `actearly` acts on the activation one step ahead."""

EVALUATIONS_MAX = 500_000
"""About 4 s. Source: measured; a minute of the double pendulum takes 183,000, of the stiffest servo 260,000."""

GLANCE = 16
"""The count and the rates are looked at this often: at every evaluation that would cost 5 %."""


@dataclass(frozen=True)
class Reference:
    """Read-only arrays: time [s] (n,), qpos (n, nq) with unit quaternions, qvel (n, nv), act (n, na)."""

    time: Vector
    qpos: Vector
    qvel: Vector
    act: Vector


def dop853(
    scene: Scene,
    times_s: Values,
    *,
    rtol: float = RTOL,
    atol: float = ATOL,
    forward: Forward = mujoco.mj_forward,
) -> Reference:
    """The scene's motion at `times_s` (ascending, from the scene's start on) by SciPy's DOP853 over `forward`.

    Raises ValueError for times that are not ascending, and where the scene has what `unreferenced` names;
    RuntimeError where the solver gives up.
    """
    obstacle = unreferenced(scene)
    if obstacle is not None:
        raise ValueError(f"a reference solution needs a scene without {obstacle}")
    # Under `discrete`, qacc would hold a difference quotient over one step: accelerations are read under Euler.
    with scene.borrow(integrator=int(mjtIntegrator.mjINT_EULER), skip=True) as workspace:
        workspace.option.timestep = TIMESTEP_S
        data, nq, nv = workspace.data, int(workspace.model.nq), int(workspace.model.nv)
        start = np.concatenate([data.qpos, data.qvel, data.act])
        values = solve(
            _rate(workspace, forward), start, np.asarray(times_s) + data.time, start_s=data.time, rtol=rtol, atol=atol
        )
        qpos = values[:, :nq].copy()
        for row in qpos:
            mujoco.mj_normalizeQuat(workspace.model, row)
    parts = (np.asarray(times_s) + scene.start.time_s, qpos, values[:, nq : nq + nv], values[:, nq + nv :])
    return Reference(*(frozen(part) for part in parts))


def unreferenced(scene: Scene) -> str | None:
    """What keeps the scene's equations from being smooth ones of its state alone; None where nothing does."""
    model, needed = scene.model, {need.part for need in scene.needs if need.needed}
    if "everything" in needed:
        return "plug-ins and sleeping bodies"
    if "constraints" in needed:
        return "contacts, limits, friction loss and equalities"
    if model.nhistory:
        return "delays, which act on a history that is no part of the equations"
    if np.any(model.actuator_actlimited):
        return "limited activations, which MuJoCo clamps after every step"
    if any(int(kind) not in PLAIN_DYNAMICS for kind in model.actuator_dyntype):
        return "dcmotor, PID and user dynamics, whose limits act step by step"
    return None


def solve(
    rate: Callable[[float, Vector], Values],
    start: Vector,
    times_s: Values,
    *,
    start_s: float = 0.0,
    rtol: float = RTOL,
    atol: float = ATOL,
) -> NDArray[np.float64]:
    """y(t) (n, size) at ascending `times_s` for y' = rate(t, y), y(start_s) = start.

    Raises ValueError for times that do not go on from `start_s`, RuntimeError where a rate is beyond mjMAXVAL or no
    number, or DOP853 gets nowhere.
    """
    times = np.asarray(times_s, dtype=np.float64)
    span = (start_s, float(times.max(initial=start_s)))
    if not (isfinite(span[1]) and span[0] < span[1] and times[0] >= start_s and np.all(np.diff(times) > 0)):
        raise ValueError(f"times must be finite and ascend from the start at {start_s:g} s")
    solution = integrate.solve_ivp(_watched(rate), span, start, method="DOP853", t_eval=times, rtol=rtol, atol=atol)
    if not solution.success:
        raise RuntimeError(f"DOP853 gave up: {solution.message}")
    return np.asarray(solution.y.T)


def _watched(rate: Callable[[float, Vector], Values]) -> Callable[[float, Vector], Values]:
    """The same, until it has been asked too often or the motion is lost; then RuntimeError."""
    evaluations = 0

    def watched(time: float, state: Vector) -> Values:
        nonlocal evaluations
        values = rate(time, state)
        if evaluations % GLANCE == 0:
            if evaluations >= EVALUATIONS_MAX:
                raise RuntimeError(f"DOP853 gave up after {evaluations} evaluations, at {time:.3g} s")
            largest = float(np.abs(values).max(initial=0.0))
            if not largest <= mujoco.mjMAXVAL:
                raise RuntimeError(f"the motion grows without bound: a rate of {largest:.2g} at {time:.3g} s")
        evaluations += 1
        return values

    return watched


def _rate(workspace: Workspace, forward: Forward) -> Callable[[float, Vector], Vector]:
    model, data = workspace.model, workspace.data
    nq, nv, na = int(model.nq), int(model.nv), int(model.na)
    position_rate = _position_rate(model)

    def rate(time: float, state: Vector) -> Vector:
        qpos, qvel = state[:nq], state[nq : nq + nv]
        data.time, data.qpos[:], data.qvel[:] = time, qpos, qvel
        if na:
            data.act[:] = state[nq + nv :]
        forward(model, data)
        return np.concatenate((position_rate(qpos, qvel), data.qacc, data.act_dot))

    return rate


def _position_rate(model: mujoco.MjModel) -> Callable[[Vector, Vector], Vector]:
    """d qpos / dt from qpos and qvel: q' = q w / 2 for quaternions, with w in the body's frame."""
    offsets = {int(mjtJoint.mjJNT_BALL): 0, int(mjtJoint.mjJNT_FREE): 3}
    joints = list(zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist(), strict=True))
    quats = [(at + offsets[kind], dof + offsets[kind]) for kind, at, dof in joints if kind in offsets]
    if not quats:
        return lambda qpos, qvel: qvel
    places = [(slice(at, at + 4), slice(dof, dof + 3)) for at, dof in quats]
    straight_q = np.delete(np.arange(model.nq), np.r_[tuple(where for where, _ in places)])
    straight_v = np.delete(np.arange(model.nv), np.r_[tuple(spin for _, spin in places)])
    turning = np.zeros(4)
    spinning = turning[1:]

    def rate(qpos: Vector, qvel: Vector) -> Vector:
        result = np.empty(len(qpos))
        if len(straight_q):
            result[straight_q] = qvel[straight_v]
        half = 0.5 * qvel
        for where, spin in places:
            spinning[:] = half[spin]
            mujoco.mju_mulQuat(result[where], qpos[where], turning)
        return result

    return rate


@dataclass(frozen=True)
class Richardson:
    """Error estimated for the finest of three solutions; not `valid` where the observed order contradicts the theory.

    `reason` says in words why (not).
    """

    error: float
    observed_order: float
    valid: bool
    reason: str


ORDER_SLACK = 0.25
"""How far the observed order may be from the method's: beyond it, the next term of the error is not small."""


def richardson(coarse: float, fine: float, order: int, *, noise: float = 1e-14) -> Richardson:
    """Estimate the error at h/4 from the distances |y(h) - y(h/2)| = `coarse` and |y(h/2) - y(h/4)| = `fine`.

    Source: Richardson 1911; error(h/4) = fine / (2^p - 1). Not valid where the distances drown in `noise`, or do
    not shrink by 2^p.
    """
    estimate = fine / (2**order - 1)
    if not (np.isfinite(coarse) and np.isfinite(fine)):
        return Richardson(float("inf"), float("nan"), False, "one of the solutions is not finite")
    if fine <= noise or coarse <= noise:
        return Richardson(max(estimate, noise), float("nan"), False, "the differences are at rounding level")
    observed = log2(coarse / fine)
    if abs(observed - order) > ORDER_SLACK:
        reason = f"the differences shrink with order {observed:.2f}, not {order}: not in the asymptotic range"
        return Richardson(estimate, observed, False, reason)
    return Richardson(estimate, observed, True, f"the differences shrink with order {observed:.2f}, as they should")


def sample_times(seconds: float, interval_s: float) -> Sequence[float]:
    """Times [s] from one interval to `seconds`, for comparisons over the whole run."""
    return [interval_s * (index + 1) for index in range(round(seconds / interval_s))]
