"""Reference solutions: DOP853 on a model's own equations through mj_forward."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from time import monotonic
from typing import Literal

import mujoco
import numpy as np
from mujoco import mjtIntegrator, mjtJoint
from numpy.typing import NDArray

from grader.numerics.accuracy.runge_kutta import PLAIN_DYNAMICS, Forward
from grader.numerics.scene import Scene, Values, Vector, freeze
from grader.numerics.workspace import Workspace

Method = Literal["DOP853", "LSODA", "Radau"]
Adaptive = Literal["RK23", "RK45", "DOP853", "LSODA"]

RTOL = 3e-14
"""Source: measured on the double pendulum; reaches 9e-15 over 1 s. SciPy refuses less than 100 rounding units."""

ATOL = 1e-15

TIMESTEP_S = 1e-15
"""Timestep [s] of the model: tiny, as an actuator with `actearly` acts on the activation one timestep ahead."""

EVALUATIONS_MAX = 500_000
"""Most evaluations of the right-hand side, about 4 s. Source: measured; a minute of the double pendulum takes 183,000,
of the stiffest servo 260,000."""

STUCK = 3000
"""Evaluations between two sample times after which an adaptive method counts as stuck, as where the motion slides along
a discontinuity. Source: measured; 24,000 take gymnasium's ant through 50 samples."""

SOLVER_TOLERANCE, SOLVER_ITERATIONS = 1e-12, 100
"""Constraint forces must be smooth to the last digits, for errors of a step to be estimated from their differences."""

CHECK_INTERVAL = 16
"""Evaluations between two checks of count and rates; a check at every evaluation would cost 5 %."""


@dataclass(frozen=True)
class Reference:
    """Read-only arrays: time [s] (n,), qpos (n, nq) with unit quaternions, qvel (n, nv), act (n, na)."""

    time: Vector
    qpos: Vector
    qvel: Vector
    act: Vector


def solve_dop853(
    scene: Scene,
    times_s: Values,
    *,
    rtol: float = RTOL,
    atol: float = ATOL,
    forward: Forward = mujoco.mj_forward,
    constraints: bool = True,
) -> Reference:
    """Solve the scene's motion at `times_s` (ascending, after the scene's start) by SciPy's DOP853 over `forward`.
    Without `constraints` the scene may have some, and `forward` must make sure that none acts. Raises ValueError for
    times that do not ascend, and for a scene with an obstacle that `find_obstacle` names; RuntimeError if the solver
    gives up."""
    obstacle = find_obstacle(scene, constraints=constraints)
    if obstacle is not None:
        raise ValueError(f"a reference solution needs a scene without {obstacle}")
    # Under `discrete`, qacc would hold a difference quotient over one step: accelerations are read under Euler.
    with scene.borrow(integrator=int(mjtIntegrator.mjINT_EULER), skip=True) as workspace:
        workspace.option.timestep = TIMESTEP_S
        data, nq, nv = workspace.data, int(workspace.model.nq), int(workspace.model.nv)
        start = np.concatenate([data.qpos, data.qvel, data.act])
        times = np.asarray(times_s) + data.time
        values = solve(build_rate(workspace, forward), start, times, start_s=data.time, rtol=rtol, atol=atol)
        qpos = values[:, :nq].copy()
        for row in qpos:
            mujoco.mj_normalizeQuat(workspace.model, row)
    parts = (np.asarray(times_s) + scene.start.time_s, qpos, values[:, nq : nq + nv], values[:, nq + nv :])
    return Reference(*(freeze(part) for part in parts))


def solve_adaptively(
    scene: Scene, times_s: Vector, *methods: Adaptive, rtol: float, until: float = inf
) -> list[Reference]:  # fmt: skip
    """Solve the scene's motion at `times_s` with its constraints by each method, up to where one of them gets stuck, or
    to `until` of the monotonic clock. Impacts shorten the steps. Raises ValueError as `solve_dop853` does."""
    obstacle = find_obstacle(scene, constraints=False)
    if obstacle is not None:
        raise ValueError(f"a reference solution needs a scene without {obstacle}")
    wanted, model = times_s + scene.start.time_s, scene.model
    solutions = (_follow(scene, wanted, method, rtol=rtol, until=until) for method in methods)
    rows = list(zip(*solutions, strict=False))  # in turn: none goes on where another is stuck
    values = np.array(rows).reshape(len(rows), len(methods), model.nq + model.nv + model.na)
    for row in values.reshape(-1, values.shape[-1]):
        mujoco.mj_normalizeQuat(model, row[: model.nq])
    bounds = np.cumsum([model.nq, model.nv])
    return [
        Reference(freeze(wanted[: len(rows)]), *map(freeze, np.split(values[:, place], bounds, axis=1)))
        for place in range(len(methods))
    ]


def _follow(scene: Scene, wanted: Vector, method: Adaptive, *, rtol: float, until: float) -> Iterator[Vector]:
    """Yields the state, (nq + nv + na,), at each of the wanted times, up to where the method gets stuck."""
    from scipy import integrate

    with scene.borrow(integrator=int(mjtIntegrator.mjINT_EULER), keep=False) as workspace:
        option, data = workspace.option, workspace.data
        option.timestep, option.solver = TIMESTEP_S, int(mujoco.mjtSolver.mjSOL_NEWTON)
        option.tolerance, option.iterations = SOLVER_TOLERANCE, SOLVER_ITERATIONS
        rate = build_rate(workspace, _build_forward_warm(data))
        start = np.concatenate([data.qpos, data.qvel, data.act])
        solver = getattr(integrate, method)(rate, data.time, start, wanted[-1], rtol=rtol, atol=rtol / 100)
        count = taken = 0
        while solver.status == "running" and solver.nfev - taken < STUCK and monotonic() < until:
            solver.step()
            reached = wanted[count : int(np.searchsorted(wanted, solver.t, side="right"))]
            if len(reached) and solver.status != "failed":
                yield from solver.dense_output()(reached).T
                count, taken = count + len(reached), solver.nfev


def _build_forward_warm(data: mujoco.MjData) -> Forward:
    """Returns mj_forward on this data, from the accelerations of the call before."""
    warmstart, qacc = data.qacc_warmstart, data.qacc

    def forward(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_forward(model, data)
        warmstart[:] = qacc

    return forward


def find_obstacle(scene: Scene, *, constraints: bool = True) -> str | None:
    """Return what prevents the scene's equations from being smooth functions of its state alone, or None."""
    model, needed = scene.model, {need.part for need in scene.needs if need.needed}
    if "everything" in needed:
        return "plug-ins and sleeping bodies"
    if constraints and "constraints" in needed:
        return "contacts, limits, friction loss and equalities"
    if model.nhistory:
        return "delays, which act on a history outside the equations"
    if np.any(model.actuator_actlimited):
        return "limited activations, which MuJoCo clamps after every step"
    if any(int(kind) not in PLAIN_DYNAMICS for kind in model.actuator_dyntype):
        return "dcmotor, PID and user dynamics, whose limits act step by step"
    return None


def solve(
    rate: Callable[[float, Vector], Values], start: Vector, times_s: Values, *, start_s: float = 0.0,
    rtol: float = RTOL, atol: float = ATOL, method: Method = "DOP853",
) -> NDArray[np.float64]:  # fmt: skip
    """y(t) (n, size) at ascending `times_s` for y' = rate(t, y), y(start_s) = start, by a method of `solve_ivp`. Raises
    ValueError for times that do not go on from `start_s`, RuntimeError where a rate exceeds mjMAXVAL or is not a
    number, or the method gives up."""
    from scipy import integrate  # SciPy takes half of the time that the grader takes to start

    times = np.asarray(times_s, dtype=np.float64)
    span = (start_s, float(times.max(initial=start_s)))
    if not (isfinite(span[1]) and span[0] < span[1] and times[0] >= start_s and np.all(np.diff(times) > 0)):
        raise ValueError(f"times must be finite and ascend from the start at {start_s:g} s")
    watched = _watch(rate, method)
    solution = integrate.solve_ivp(watched, span, start, method=method, t_eval=times, rtol=rtol, atol=atol)
    if not solution.success:
        raise RuntimeError(f"{method} gave up: {solution.message}")
    return np.asarray(solution.y.T)


def _watch(rate: Callable[[float, Vector], Values], method: str) -> Callable[[float, Vector], Values]:
    """`rate` with checks: RuntimeError after EVALUATIONS_MAX evaluations, or if a rate exceeds mjMAXVAL or is NaN."""
    evaluations = 0

    def watched(time: float, state: Vector) -> Values:
        nonlocal evaluations
        values = rate(time, state)
        if evaluations % CHECK_INTERVAL == 0:
            if evaluations >= EVALUATIONS_MAX:
                raise RuntimeError(f"{method} gave up after {evaluations} evaluations, at {time:.3g} s")
            largest = float(np.abs(values).max(initial=0.0))
            if not largest <= mujoco.mjMAXVAL:
                raise RuntimeError(f"the motion grows without bound: a rate of {largest:.2g} at {time:.3g} s")
        evaluations += 1
        return values

    return watched


def build_rate(workspace: Workspace, forward: Forward = mujoco.mj_forward) -> Callable[[float, Vector], Vector]:
    """Returns the model's equations of motion: the derivative of (qpos, qvel, act) at a time [s] and such a state. Each
    call writes into the data of the workspace. Quaternions turn by q' = q w / 2."""
    model, data = workspace.model, workspace.data
    nq, nv, na = int(model.nq), int(model.nv), int(model.na)
    position_rate = _build_position_rate(model)
    own_qpos, own_qvel, own_act, qacc, act_dot = data.qpos, data.qvel, data.act, data.qacc, data.act_dot

    def rate(time: float, state: Vector) -> Vector:
        qpos, qvel = state[:nq], state[nq : nq + nv]
        data.time, own_qpos[:], own_qvel[:] = time, qpos, qvel
        if na:
            own_act[:] = state[nq + nv :]
        forward(model, data)
        return np.concatenate((position_rate(qpos, qvel), qacc, act_dot))

    return rate


def _build_position_rate(model: mujoco.MjModel) -> Callable[[Vector, Vector], Vector]:
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


def list_sample_times(seconds: float, interval_s: float) -> Sequence[float]:
    """Times [s] from one interval to `seconds`, for comparisons over the whole run."""
    return [interval_s * (index + 1) for index in range(round(seconds / interval_s))]
