"""The exact motion with the hidden force, and how far from it a trajectory is."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from grader.grading.rk4.parameters import Problem, Run, replaced
from grader.grading.rk4.trajectories import Trajectory, difference, forward_of
from grader.numerics.reference import dop853

SAMPLES = 5
"""Times at which a run is held against the truth, the last at its end."""

ORDER_RTOL = 1e-13
"""Leaves the truth with an error of 1e-12, a thirtieth of the smallest error that the order check meets (3e-11)."""

CASE_RTOL = 1e-12
"""Leaves it with an error of 1e-11, a tenth of what counts as round-off in a case that is not asked for its order."""

ORDER = 4.0
"""Of the methods that the exercise asks for, and of our yardstick."""


@dataclass(frozen=True)
class Truth:
    """One motion, at every time [s] at which some trajectory of it is held against it; solved when first asked."""

    run: Run
    times_s: tuple[float, ...]
    rtol: float

    def error(self, run: Run, trajectory: Trajectory) -> float:
        """Sup norm of the distance at the run's sample times; inf where the trajectory ended early.

        Raises ValueError where the scene has constraints.
        """
        exact = solved(replaced(self.run, 1.0, 1), self.times_s, self.rtol)
        rows = sampled_rows(run)
        here = np.searchsorted(self.times_s, sample_times(run))
        return difference(run, trajectory.at(rows[rows < len(trajectory)]), exact.at(here)).worst


def truth_of(problem: Problem, index: int) -> Truth:
    """The truth of a case; that of the first serves the runs of the order check too, which start alike."""
    run = problem.runs[index]
    judged = [run, coarser(run)[0]] if problem.may_converge else []
    order = [problem.runs[i] for i in problem.order_runs] if index == 0 else []
    times = sorted({time for other in judged + order for time in sample_times(other)})
    return Truth(run, tuple(times), ORDER_RTOL if order else CASE_RTOL)


def coarser(run: Run) -> tuple[Run, float]:
    """A run of the same motion with half as many steps, and how many times larger a fourth-order error is there.

    The run itself where its steps cannot be halved.
    """
    half = run.steps // 2
    if run.steps % 2 or half < SAMPLES:
        return run, 1.0
    return replaced(run, 2 * run.timestep_s, half), 2**ORDER


def sampled_rows(run: Run) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """The rows of a trajectory that are held against the truth."""
    return np.array([round(run.steps * (i + 1) / SAMPLES) for i in range(SAMPLES)]) - 1


def sample_times(run: Run) -> tuple[float, ...]:
    """The times [s] of those rows."""
    return tuple(round((row + 1) * run.timestep_s, 12) for row in sampled_rows(run).tolist())


@lru_cache(maxsize=64)
def solved(run: Run, times_s: tuple[float, ...], rtol: float) -> Trajectory:
    """The motion at ascending times [s]. Raises ValueError where the scene has constraints."""
    reference = dop853(run.scene(), times_s, rtol=rtol, forward=forward_of(run))
    return Trajectory(reference.time, reference.qpos, reference.qvel, reference.act)
