"""Runs a scene under a setting, and measures errors against a reference, in positions or in a quantity."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isclose, isfinite

import mujoco
import numpy as np

from grader.numerics.accuracy.convergence import measure_distance, measure_position_distance
from grader.numerics.accuracy.reference import Reference, list_sample_times
from grader.numerics.integrators import Integrator
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import Scene, Vector
from grader.studies.advise.measures import measure_quantity

SAMPLE_S = 0.02
"""Errors are evaluated at multiples of this in runs of a second or more; every timestep in TIMESTEPS_S divides it."""

SHORTER_S = (0.01, 0.002, 0.001)
"""The same in shorter runs: the largest that gives SAMPLES. A timestep that does not divide it is compared at common
multiples alone. 5 ms is left out, as runs at 2 ms would be compared every 10 ms there."""

SAMPLES = 50
"""Least number of samples, where the shortest interval gives so many: those of a second at SAMPLE_S."""

Quantity = Callable[[mujoco.MjModel, mujoco.MjData], float]
States = Rollout | Reference

Setting = tuple[Integrator, float]
"""An integrator and a timestep [s]."""


@dataclass(frozen=True)
class Run:
    """One run with its CPU time per simulated second."""

    rollout: Rollout
    cpu: float


class Meter:
    """Runs a scene and measures errors against a reference, in positions or in a quantity."""

    def __init__(
        self, scene: Scene, seconds: float, quantity: Quantity | None, interval_s: float = SAMPLE_S
    ) -> None:  # fmt: skip
        self.scene, self.quantity, self.interval_s = scene, quantity, interval_s
        self.grid_s = np.asarray(list_sample_times(seconds, interval_s))
        self.seconds = float(self.grid_s[-1])

    def times_of(self, timestep_s: float) -> Vector:
        """Returns the times [s] at which a run is compared: its steps at multiples of the interval. A timestep that
        does not divide SAMPLE_S has none, and is compared at the steps nearest to them."""
        steps = self.grid_s / timestep_s
        if isclose(SAMPLE_S / timestep_s, round(SAMPLE_S / timestep_s)):
            steps = steps[np.abs(steps - np.rint(steps)) < 1e-6]
        steps = np.unique(np.rint(steps))
        return np.asarray(steps[steps > 0] * timestep_s)

    def run(self, setting: Setting, at_s: Vector | None = None) -> Run:
        """Returns a run that is kept at these times after the start [s], by default where it is compared."""
        integrator, timestep_s = setting
        times = self.times_of(timestep_s) if at_s is None else at_s
        begin = time.thread_time()
        rollout = simulate(
            self.scene, seconds=float(times[-1]), timestep_s=timestep_s, integrator=integrator.code, at_s=times
        )
        spent = time.thread_time() - begin
        return Run(rollout, spent / max(rollout.steps * timestep_s, timestep_s))

    def cut(self, run: Run) -> Run:
        """Returns the beginning of a run of the same scene that lasted longer: the states that `run` would keep."""
        rollout = run.rollout
        steps = round(float(self.times_of(rollout.timestep_s)[-1]) / rollout.timestep_s)
        if rollout.steps < steps:  # it diverged within this time
            return run
        count = int(np.searchsorted(rollout.step, steps, side="right"))
        beginning = rollout._replace(
            step=rollout.step[:count], states=rollout.states[:count], steps=steps, diverged_at_step=None, warning=None
        )
        return replace(run, rollout=beginning)

    def reference_run(self, setting: Setting, times_s: Vector) -> Rollout:
        """Returns a run that is kept at the steps on both sides of every time."""
        timestep_s = setting[1]
        steps = times_s / timestep_s
        around = np.unique(np.concatenate([np.floor(steps + 1e-6), np.ceil(steps - 1e-6)]))
        return self.run(setting, np.asarray(around * timestep_s)).rollout

    def error(self, one: States, other: States) -> float:
        """Returns the sup norm of the difference at the times of `one`; inf if it diverged."""
        if isinstance(one, Rollout) and one.diverged_at_step is not None:
            return inf
        if isinstance(other, Rollout) and other.diverged_at_step is not None:
            return inf
        second = interpolate(self.scene, other, one.time)
        if self.quantity is None:
            return measure_distance(self.scene, one, second).qpos
        values = (measure_quantity(self.scene, run, self.quantity) for run in (one, second))
        largest = float(np.max(np.abs(np.subtract(*values)), initial=0.0))
        return largest if isfinite(largest) else inf

    def distances(self, one: States, other: States, times_s: Vector) -> Vector:
        """Returns the largest difference up to each of these times after the start, (n,); inf where a run ended."""
        distances = np.full(len(times_s), inf)
        times = times_s + self.scene.start.time_s
        count = int(np.sum(times <= min(one.time[-1], other.time[-1]) + 1e-9)) if min(map(_count, (one, other))) else 0
        first, second = (interpolate(self.scene, run, times[:count]) for run in (one, other))
        if self.quantity is None:
            for row, (a, b) in enumerate(zip(first.qpos, second.qpos, strict=True)):
                distances[row] = measure_position_distance(self.scene, a[None], b[None])
        else:
            values = (measure_quantity(self.scene, run, self.quantity) for run in (first, second))
            distances[:count] = np.abs(np.subtract(*values))
        distances[np.isnan(distances)] = inf
        return np.asarray(np.maximum.accumulate(distances))

    def excursion(self, run: Rollout) -> float:
        """How far the quantity moves from its start; inf for a run that diverged."""
        if run.diverged_at_step is not None:
            return inf
        if self.quantity is None:
            start = np.tile(self.scene.start.qpos, (len(run.qpos), 1))
            return measure_position_distance(self.scene, run.qpos, start)
        still = simulate(self.scene, steps=0)
        values = measure_quantity(self.scene, run, self.quantity)
        return float(np.max(np.abs(values - measure_quantity(self.scene, still, self.quantity)[0]), initial=0.0))


def choose_interval(seconds: float) -> float:
    """Returns the interval [s] at which runs of this length are compared."""
    fitting = (interval_s for interval_s in (SAMPLE_S, *SHORTER_S) if seconds >= SAMPLES * interval_s * (1 - 1e-9))
    return next(fitting, SHORTER_S[-1])


def interpolate(scene: Scene, run: States, times: Vector) -> Reference:
    """States at `times`, between two kept ones by linear interpolation. The reference keeps a state within one of its
    own timesteps on both sides of each time: the error is of second order in that timestep."""
    after = np.clip(np.searchsorted(run.time, times - 1e-9), 0, len(run.time) - 1)
    before = np.where(np.abs(run.time[after] - times) < 1e-9, after, np.maximum(after - 1, 0))
    width = run.time[after] - run.time[before]
    share = np.divide(times - run.time[before], width, out=np.zeros(len(times)), where=width > 0)[:, None]
    qpos, qvel, act = (
        (1 - share) * part[before] + share * part[after] if share.any() else part[after]
        for part in (run.qpos, run.qvel, run.act)
    )
    for row in qpos if share.any() else ():
        mujoco.mj_normalizeQuat(scene.model, row)
    return Reference(times, qpos, qvel, act)


def extrapolate(scene: Scene, coarse: Reference, fine: Reference) -> Reference:
    """Returns the first-order extrapolation of two solutions at the same times, one at half the other's timestep."""
    qpos, qvel, act = (
        2 * b - a for a, b in ((coarse.qpos, fine.qpos), (coarse.qvel, fine.qvel), (coarse.act, fine.act))
    )
    for row in qpos:
        mujoco.mj_normalizeQuat(scene.model, row)
    return Reference(fine.time, qpos, qvel, act)


def _count(run: States) -> int:
    return len(run.time)
