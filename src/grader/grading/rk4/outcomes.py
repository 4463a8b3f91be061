"""What became of each run: how far the student is from MuJoCo's method and from the truth, and what that counts."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from grader.grading.rk4.parameters import OrderCheck, Problem, Rk4Case, Run
from grader.grading.rk4.trajectories import (
    Difference,
    Trajectory,
    difference,
    fourth_order,
    mujocos,
    read_trajectory,
)
from grader.grading.rk4.truth import Truth, coarser, truth_of
from grader.numerics.convergence import observed_order

TIME_ROUNDING_S = 1e-9
"""A sum of a few thousand timesteps in double precision drifts by less than this."""

NEARNESS = 20.0
"""How many times further from the truth than our own fourth-order method a fourth-order method may be.

Source: error constants of the classical fourth-order tableaus lie within a factor of ten of each other; MuJoCo
3.14.0's second-order treatment of rotations is 100 to 40,000 times further away.
"""

TRUTH_FLOOR = 1e-10
"""Below this, an error is round-off, not order."""

MUJOCO_ORDER = 2.0
"""On rotations. Source: slope 2.00 measured with MuJoCo 3.14.0's RK4."""


@dataclass(frozen=True)
class Outcome:
    """One case. The two errors against the truth are measured only where they may decide."""

    case: Rk4Case
    title: str
    run: Run
    student: Trajectory
    may_converge: bool
    truth: Truth

    @cached_property
    def difference(self) -> Difference:
        """To MuJoCo's method."""
        return difference(self.run, self.student, mujocos(self.run))

    @cached_property
    def agrees(self) -> bool:
        """With MuJoCo's method, in every position, velocity and activation, at every step."""
        return self.difference.worst <= self.case.tolerance

    @cached_property
    def is_near_truth(self) -> bool:
        """As near to the truth as a fourth-order method is; only asked where that counts."""
        if not self.may_converge or self.agrees:
            return False
        if self.error > 2 * NEARNESS * self.truth.error(self.run, mujocos(self.run)) + TRUTH_FLOOR:
            return False  # ours need not be simulated: it is no further from the truth than MuJoCo's
        coarse, factor = coarser(self.run)
        ours = self.truth.error(coarse, fourth_order(coarse)) / factor
        return self.error <= NEARNESS * ours + TRUTH_FLOOR

    @cached_property
    def error(self) -> float:
        """To the truth."""
        return self.truth.error(self.run, self.student)

    @cached_property
    def keeps_time(self) -> bool:
        """Whether data.time is where it should be, in a case where that matters."""
        if not self.case.time_matters:
            return True
        late = self.student.time - mujocos(self.run).time[: len(self.student)]
        return len(late) == self.run.steps and bool(np.all(np.abs(late) <= TIME_ROUNDING_S))

    @cached_property
    def right(self) -> bool:
        """Whether the case counts."""
        return self.keeps_time and (self.agrees or self.is_near_truth)

    @cached_property
    def first_departure(self) -> int | None:
        """The first step whose difference exceeds the tolerance, counted from 1."""
        over = np.flatnonzero(self.difference.by_step > self.case.tolerance)
        if len(over):
            return int(over[0]) + 1
        return None if self.difference.complete else len(self.student) + 1


@dataclass(frozen=True)
class OrderOutcome:
    """The observed order on the first case; None where the errors show none."""

    check: OrderCheck
    errors: tuple[float, ...]

    @cached_property
    def slope(self) -> float | None:
        """Of log error over log timestep."""
        if not all(isfinite(error) and error > 0 for error in self.errors):
            return None
        return observed_order(self.check.timesteps_s, self.errors).order

    def is_about(self, order: float) -> bool:
        """Whether the slope is this order."""
        return self.slope is not None and abs(self.slope - order) <= self.check.tolerance


def judge_cases(problem: Problem, results: Mapping[str, NDArray[np.generic]]) -> list[Outcome]:
    """Every case of a submission."""
    cases = zip(problem.parameters.cases, problem.titles, problem.runs, strict=False)
    return [
        Outcome(case, title, run, read_trajectory(results, index, run), problem.may_converge, truth_of(problem, index))
        for index, (case, title, run) in enumerate(cases)
    ]


def judge_order(problem: Problem, results: Mapping[str, NDArray[np.generic]]) -> OrderOutcome | None:
    """The errors at every timestep of the order check; None where the author wants none."""
    check = problem.parameters.order
    if check is None:
        return None
    truth = truth_of(problem, 0)
    runs = [(problem.runs[index], index) for index in problem.order_runs]
    errors = tuple(truth.error(run, read_trajectory(results, index, run)) for run, index in runs)
    return OrderOutcome(check, errors)
