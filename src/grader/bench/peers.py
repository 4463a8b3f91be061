"""What a user would pick instead: the lesson's Python loop, SciPy, Pinocchio, Drake, each at several settings.

A peer is a function of one setting (a timestep or a tolerance) that integrates a scene over the sample times and
returns qpos there, shape (len(times), nq), in MuJoCo's coordinates.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from grader.bench.by_hand import EQUATIONS, Array
from grader.bench.settings_grid import INTEGRATORS, TIMESTEPS_S
from grader.bench.wheel_timer import profiling_timer
from grader.numerics.scene import Scene

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Relative tolerances that the adaptive peers are run with."""

Run = Callable[[float, Array], Array]


@dataclass(frozen=True)
class Peer:
    """One alternative on one scene; `settings` are timesteps [s] or tolerances."""

    name: str
    run: Run
    settings: Sequence[float]


def peers_of(name: str, scene: Scene) -> list[Peer]:
    """The peers of a scene that are there on this machine; SciPy needs no package that we do not have."""
    from grader.bench.peers_optional import optional_peers

    found = [Peer(f"Python loop, {kind}", python_loop(scene, kind), TIMESTEPS_S) for kind in ("Euler", "RK4")]
    for method in ("LSODA", "DOP853"):
        if name in EQUATIONS:
            found.append(Peer(f"SciPy {method}, by hand", by_hand(name, scene, method), TOLERANCES))
        found.append(Peer(f"SciPy {method}, mj_forward", over_mj_forward(scene, method), TOLERANCES))
    return found + optional_peers(name, scene)


def python_loop(scene: Scene, integrator: str) -> Run:
    """The lesson's loop: one `mj_step` per call from Python, the wheel's timer on, nothing skipped."""
    with scene.borrow(integrator=INTEGRATORS[integrator], keep=False) as workspace:
        model, data = workspace.model, workspace.data
    start = scene.start

    def run(timestep_s: float, times: Array) -> Array:
        model.opt.timestep = timestep_s
        mujoco.mj_resetData(model, data)
        data.qpos, data.qvel = start.qpos, start.qvel
        samples = np.empty((len(times), model.nq))
        samples[0] = data.qpos
        with profiling_timer():
            for row in range(1, len(times)):
                for _ in range(round((times[row] - times[row - 1]) / timestep_s)):
                    mujoco.mj_step(model, data)
                samples[row] = data.qpos
        return samples

    return run


def by_hand(name: str, scene: Scene, method: str) -> Run:
    """SciPy on the equations that the user derived."""
    derivative = EQUATIONS[name]
    state = np.concatenate([scene.start.qpos, scene.start.qvel])
    nq = len(scene.start.qpos)

    def run(tolerance: float, times: Array) -> Array:
        return solve(derivative, state, method, tolerance, times)[:, :nq]

    return run


def over_mj_forward(scene: Scene, method: str) -> Run:
    """SciPy with accelerations from `mj_forward`; quaternions move by q (0, w) / 2, normalised before use."""
    with scene.borrow(keep=False, skip=True) as workspace:
        model, data = workspace.model, workspace.data
    start = scene.start
    nq = int(model.nq)
    rates = position_rates(model)

    def derivative(time: float, state: Array) -> Array:
        data.time = time
        data.qpos, data.qvel = state[:nq], state[nq:]
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_forward(model, data)
        return np.concatenate([rates(state[:nq], state[nq:]), data.qacc])

    def run(tolerance: float, times: Array) -> Array:
        mujoco.mj_resetData(model, data)
        states = solve(derivative, np.concatenate([start.qpos, start.qvel]), method, tolerance, times)
        return states[:, :nq]

    return run


def position_rates(model: mujoco.MjModel) -> Callable[[Array, Array], Array]:
    """dqpos/dt from qpos and qvel: qvel itself on hinges and slides, q (0, w) / 2 on one free joint."""
    if model.nq == model.nv:
        return lambda _qpos, qvel: qvel
    if model.njnt != 1:
        raise ValueError("only a scene of one free joint has quaternion rates here")
    turn, spin = np.empty(4), np.zeros(4)

    def rates(qpos: Array, qvel: Array) -> Array:
        spin[1:] = qvel[3:6] / 2
        mujoco.mju_mulQuat(turn, qpos[3:7], spin)  # mju_derivQuat takes the velocity in the world's frame
        return np.concatenate([qvel[:3], turn])

    return rates


def solve(
    derivative: Callable[[float, Array], Any], state: Array, method: Any, tolerance: float, times: Array
) -> Array:
    """`solve_ivp` at one tolerance, absolute and relative; states at the times, shape (len(times), n)."""
    solution = solve_ivp(
        derivative, (times[0], times[-1]), state, method=method, t_eval=times, rtol=tolerance, atol=tolerance / 10
    )
    if not solution.success:
        raise ArithmeticError(solution.message)
    return np.asarray(solution.y.T)
