"""Trajectories: the student's as read from plain arrays, ours as simulated with the same hidden force."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from math import inf

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.grading.drivers.hidden_force import Forward, with_force
from grader.grading.rk4.parameters import Run
from grader.numerics.rk4 import lie_rk4_step, mujoco_rk4_step
from grader.numerics.rollout import Rollout, simulate

Rows = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """The state after each step: time [s] (n,), qpos (n, nq), qvel (n, nv), act (n, na)."""

    time: Rows
    qpos: Rows
    qvel: Rows
    act: Rows

    def first(self, rows: int) -> "Trajectory":
        """The beginning."""
        return self.at(slice(rows))

    def at(self, rows: slice | NDArray[np.int64]) -> "Trajectory":
        """Some of the rows."""
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
        """Over the whole run; inf where the student's run ended early."""
        parts = {"qpos": self.qpos, "qvel": self.qvel} | ({"act": self.act} if self.act.any() else {})
        return {name: float(np.max(part, initial=0.0)) if self.complete else inf for name, part in parts.items()}

    @property
    def worst(self) -> float:
        """The largest of all."""
        return max(self.largest.values())

    @property
    def by_step(self) -> Rows:
        """The larger of positions, velocities and activations at each step."""
        return np.maximum(np.maximum(self.qpos, self.qvel), self.act)


def read_trajectory(results: Mapping[str, NDArray[np.generic]], index: int, run: Run) -> Trajectory:
    """The student's trajectory of run `index`; what does not have the shape that the driver gives it is empty."""
    widths = {"t": 1, "q": len(run.qpos), "v": len(run.qvel), "a": len(run.act)}
    parts: dict[str, Rows] = {}
    for name, width in widths.items():
        values = results.get(f"{name}{index}")
        if values is None or values.dtype != np.float64 or values.ndim != 2 or values.shape[1] != width:
            return Trajectory(*(np.empty((0, w)) for w in (0, *list(widths.values())[1:])))
        parts[name] = values.astype(np.float64)
    rows = min(run.steps, *(len(part) for part in parts.values()))
    return Trajectory(parts["t"][:rows, 0], *(parts[name][:rows] for name in "qva"))


def difference(run: Run, one: Trajectory, other: Trajectory) -> Difference:
    """Step by step, over the rows that both have; complete where `one` has all that `other` has."""
    rows = min(len(one), len(other))
    turn = turned(run, one.qpos[:rows], other.qpos[:rows])
    return Difference(
        qpos=sup(turn),
        qvel=sup(one.qvel[:rows] - other.qvel[:rows]),
        act=sup(one.act[:rows] - other.act[:rows]),
        complete=len(one) >= len(other),
    )


def sup(values: Rows) -> Rows:
    """The largest size in each row."""
    return np.array(np.max(np.abs(values), axis=1, initial=0.0))


def turned(run: Run, one: Rows, other: Rows) -> Rows:
    """From positions `one` to `other` as tangent vectors (n, nv).

    The length of a quaternion does not count: MuJoCo normalises wherever it reads one, so it is no part of the state.
    """
    if len(run.qpos) == len(run.qvel):
        return other - one
    model = run.scene().model
    turn = np.zeros((len(one), model.nv))
    for row, first, second in zip(turn, one, other, strict=True):
        mujoco.mj_differentiatePos(model, row, 1.0, first, second)
    return turn


def forward_of(run: Run) -> Forward:
    """mj_forward with the run's hidden force."""
    return with_force(mujoco.mj_forward, vars(run.force))


def steps_of(rollout: Rollout) -> Trajectory:
    """A rollout without its start."""
    return Trajectory(rollout.time[1:], rollout.qpos[1:], rollout.qvel[1:], rollout.act[1:])


Step = Callable[[mujoco.MjModel, mujoco.MjData], object]


def stepped(run: Run, step: Step, steps: int | None = None) -> Trajectory:
    """Our own run with `step` in place of mj_step."""
    return steps_of(simulate(run.scene(), steps=steps or run.steps, timestep_s=run.timestep_s, stepper=step))


@lru_cache(maxsize=256)
def mujocos(run: Run) -> Trajectory:
    """By MuJoCo 3.14.0's RK4, with the hidden force."""
    return stepped(run, partial(mujoco_rk4_step, forward=forward_of(run)))


@lru_cache(maxsize=64)
def fourth_order(run: Run) -> Trajectory:
    """By a method that is of fourth order on rotations too, with the hidden force."""
    return stepped(run, partial(lie_rk4_step, forward=forward_of(run)))


@lru_cache(maxsize=64)
def unforced(run: Run, integrator: int, steps: int) -> Trajectory:
    """By MuJoCo's own mj_step, which knows nothing of the hidden force."""
    return steps_of(simulate(run.scene(), steps=steps, timestep_s=run.timestep_s, integrator=integrator))
