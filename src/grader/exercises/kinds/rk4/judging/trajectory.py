"""Trajectories of steps: those that a script claims, our own simulations, and the difference between two."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from math import inf

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.exercises.judgement import Results
from grader.exercises.kinds.rk4.judging.driver import Forward, add_force
from grader.exercises.kinds.rk4.judging.quaternions import find_quaternions
from grader.exercises.kinds.rk4.judging.run import Run
from grader.numerics.accuracy.runge_kutta import step_lie_rk4, step_mujoco_rk4
from grader.numerics.rollout import Rollout, simulate

Rows = NDArray[np.float64]

QUATERNION_LENGTHS = 0.1, 10.0
"""A quaternion that is shorter or longer than this is infinitely far from every other.

MuJoCo finds one of length 0, and one whose square overflows, equal to every other. A right step that does not
normalise its quaternions keeps them near length 1.
"""


@dataclass(frozen=True)
class Trajectory:
    """The state after each step: time [s] (n,), qpos (n, nq), qvel (n, nv), act (n, na)."""

    time: Rows
    qpos: Rows
    qvel: Rows
    act: Rows

    def take_first(self, rows: int) -> "Trajectory":
        """Returns the first rows."""
        return self.take(slice(rows))

    def take(self, rows: slice | NDArray[np.int64]) -> "Trajectory":
        """Returns the chosen rows."""
        return Trajectory(self.time[rows], self.qpos[rows], self.qvel[rows], self.act[rows])

    def __len__(self) -> int:
        return len(self.qpos)


@dataclass(frozen=True)
class Difference:
    """Sup norm of each step's difference (n,): positions (rotations as vectors), velocities, activations."""

    qpos: Rows
    qvel: Rows
    act: Rows
    complete: bool

    @property
    def largest(self) -> dict[str, float]:
        """The largest of each part over the whole run; inf where the student's run ended early."""
        parts = {"qpos": self.qpos, "qvel": self.qvel} | ({"act": self.act} if self.act.any() else {})
        return {name: float(np.max(part, initial=0.0)) if self.complete else inf for name, part in parts.items()}

    @property
    def worst(self) -> float:
        """The largest over all parts."""
        return max(self.largest.values())

    @property
    def by_step(self) -> Rows:
        """The larger of positions, velocities and activations at each step."""
        return np.maximum(np.maximum(self.qpos, self.qvel), self.act)


def read_trajectory(results: Results, index: int, run: Run) -> Trajectory:
    """Returns the student's trajectory of run `index`; empty if an array has not the shape that the driver gives it."""
    widths = {"t": 1, "q": len(run.qpos), "v": len(run.qvel), "a": len(run.act)}
    parts: dict[str, Rows] = {}
    for name, width in widths.items():
        values = results.get(f"{name}{index}")
        if values is None or values.dtype != np.float64 or values.ndim != 2 or values.shape[1] != width:
            return Trajectory(*(np.empty((0, w)) for w in (0, *list(widths.values())[1:])))
        parts[name] = values.astype(np.float64)
    rows = min(run.steps, *(len(part) for part in parts.values()))
    return Trajectory(parts["t"][:rows, 0], *(parts[name][:rows] for name in "qva"))


def compare(run: Run, one: Trajectory, other: Trajectory) -> Difference:
    """Returns the difference at each common step; complete if `one` has every step of `other`."""
    rows = min(len(one), len(other))
    return Difference(
        qpos=compute_row_maxima(subtract_positions(run, one.qpos[:rows], other.qpos[:rows])),
        qvel=compute_row_maxima(one.qvel[:rows] - other.qvel[:rows]),
        act=compute_row_maxima(one.act[:rows] - other.act[:rows]),
        complete=len(one) >= len(other),
    )


def compute_row_maxima(values: Rows) -> Rows:
    """Returns the largest absolute value of each row; inf where one is nan, which compares as neither far nor near."""
    largest: Rows = np.nan_to_num(np.max(np.abs(values), axis=1, initial=0.0), nan=inf, posinf=inf)
    return largest


def subtract_positions(run: Run, one: Rows, other: Rows) -> Rows:
    """Returns the tangent vectors (n, nv) that lead from positions `one` to `other`. The length of a quaternion does
    not count within QUATERNION_LENGTHS: MuJoCo normalises wherever it reads one, so it is no part of the state."""
    if len(run.qpos) == len(run.qvel):
        return other - one
    model = run.scene().model
    turn = np.zeros((len(one), model.nv))
    for row, first, second in zip(turn, one, other, strict=True):
        mujoco.mj_differentiatePos(model, row, 1.0, first, second)
    shortest, longest = QUATERNION_LENGTHS
    for quaternion in find_quaternions(model):
        for positions in (one, other):
            length = np.linalg.norm(positions[:, quaternion.qpos : quaternion.qpos + 4], axis=1)
            turn[~((length >= shortest) & (length <= longest))] = inf
    return turn


def build_forward(run: Run) -> Forward:
    """Returns mj_forward with the run's hidden force added."""
    return add_force(mujoco.mj_forward, vars(run.force))


def drop_start(rollout: Rollout) -> Trajectory:
    """Returns the states of a rollout after its start."""
    return Trajectory(rollout.time[1:], rollout.qpos[1:], rollout.qvel[1:], rollout.act[1:])


Step = Callable[[mujoco.MjModel, mujoco.MjData], object]


def simulate_with(run: Run, step: Step, steps: int | None = None) -> Trajectory:
    """Simulates the run with `step` in place of mj_step."""
    return drop_start(simulate(run.scene(), steps=steps or run.steps, timestep_s=run.timestep_s, stepper=step))


@lru_cache(maxsize=256)
def simulate_mujoco(run: Run) -> Trajectory:
    """Simulates the run by the installed MuJoCo's RK4 with the hidden force."""
    return simulate_with(run, partial(step_mujoco_rk4, forward=build_forward(run)))


@lru_cache(maxsize=64)
def simulate_fourth_order(run: Run) -> Trajectory:
    """Simulates the run by a method of fourth order, rotations included, with the hidden force."""
    return simulate_with(run, partial(step_lie_rk4, forward=build_forward(run)))


@lru_cache(maxsize=64)
def simulate_unforced(run: Run, integrator: int, steps: int) -> Trajectory:
    """Simulates the run by mj_step, which lacks the hidden force."""
    return drop_start(simulate(run.scene(), steps=steps, timestep_s=run.timestep_s, integrator=integrator))
