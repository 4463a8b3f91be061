"""What became of each run: how far the student is from MuJoCo's method and from the truth, and what that counts."""

from collections.abc import Mapping, Sequence
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
from grader.grading.rk4.truth import ORDER, Truth, coarser, truth_of
from grader.numerics.convergence import observed_order

TIME_ROUNDING_S = 1e-9
"""A sum of a few thousand timesteps in double precision drifts by less than this."""

NEARNESS = 20.0
"""How many times further from the truth than our own fourth-order method a fourth-order method may be.

Source: error constants of the classical fourth-order tableaus lie within a factor of ten of each other; MuJoCo
3.14.0's second-order treatment of rotations is 100 to 40,000 times further away.
"""

TRUTH_FLOOR = 1e-10
"""Below this, an error is round-off, not order: left out of the fit of an order.

Source: the truth of a case is exact to 1e-11; methods that choose their own substeps stop at about 3e-11.
"""

FEWEST = 3
"""Points through which a slope is laid."""

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
    """The errors on the first case at every timestep, and the order that they show.

    `ignores_timestep`: the states after each step were the same at every timestep.
    """

    check: OrderCheck
    errors: tuple[float, ...]
    ignores_timestep: bool
    coarsest: Run
    truth: Truth

    @cached_property
    def finite(self) -> bool:
        """Whether every run reached its end."""
        return all(isfinite(error) for error in self.errors)

    @cached_property
    def slope(self) -> float | None:
        """Of log error over log timestep, without the errors that are round-off; None where too few are left."""
        points = [
            (h, error) for h, error in zip(self.check.timesteps_s, self.errors, strict=True) if error > TRUTH_FLOOR
        ]
        if not self.finite or len(points) < FEWEST:
            return None
        return observed_order(*zip(*points, strict=True)).order

    def is_about(self, order: float) -> bool:
        """Whether the slope is this order."""
        return self.slope is not None and abs(self.slope - order) <= self.check.tolerance

    @cached_property
    def is_fourth(self) -> bool:
        """Fourth order or more, or errors as small as those of a fourth-order method.

        The latter decides alone where the slope is steeper, which may come of a run that went wild at the largest
        timestep, and where too few errors are left for a slope.
        """
        if not self.finite or self.ignores_timestep:
            return False
        if self.slope is not None and self.slope < ORDER + self.check.tolerance:
            return self.is_about(ORDER)
        return self.is_accurate

    @cached_property
    def is_accurate(self) -> bool:
        """Whether no error is larger than that of a fourth-order method may be at its timestep."""
        ours = self.truth.error(self.coarsest, fourth_order(self.coarsest))
        allowed = (NEARNESS * ours * (h / self.coarsest.timestep_s) ** ORDER for h in self.check.timesteps_s)
        return all(error <= most + TRUTH_FLOOR for error, most in zip(self.errors, allowed, strict=True))


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
    runs = [problem.runs[index] for index in problem.order_runs]
    students = [read_trajectory(results, index, run) for index, run in zip(problem.order_runs, runs, strict=True)]
    errors = tuple(truth.error(run, student) for run, student in zip(runs, students, strict=True))
    coarsest = max(runs, key=lambda run: run.timestep_s)
    return OrderOutcome(check, errors, all_alike(students), coarsest, truth)


def all_alike(students: Sequence[Trajectory]) -> bool:
    """Whether the states after each step are the same in all runs, and do move."""
    rows = min(map(len, students))
    one, *others = (np.hstack([student.qpos[:rows], student.qvel[:rows]]) for student in students)
    return rows > 1 and not np.all(one == one[0]) and all(np.array_equal(one, other) for other in others)
