"""Judges steps: measures the distance of the student's trajectories from MuJoCo's method and from the exact motion."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np

from grader.exercises.judgement import Judgement, Results
from grader.exercises.kinds.rk4.judging.run import OrderMeasurement, Problem, Run, with_timestep
from grader.exercises.kinds.rk4.judging.trajectory import (
    Difference,
    Trajectory,
    compare,
    read_trajectory,
    simulate_fourth_order,
    simulate_mujoco,
)
from grader.numerics.version import INSTALLED, RK4_ORDER_ON_ROTATIONS

TIME_ROUNDING_S = 1e-9
"""A sum of a few thousand timesteps in double precision drifts by less than this."""

TIMESTEP_RTOL = 1e-3
"""Relative difference below which a step took the timestep it was given: far more than round-off of data.time."""

OTHER_METHODS = 1e-4
"""The largest distance of a right trajectory of another method from MuJoCo's [rad/s, m/s].

Source: true fourth-order methods differ from MuJoCo 3.14.0's by at most 8.7e-5 over 1 s.
"""

NEARNESS = 20.0
"""The largest error of a fourth-order method, as a multiple of the error of our own one.

Source: error constants of the classical fourth-order tableaus lie within a factor of ten of each other; MuJoCo
3.14.0's second-order treatment of rotations is 100 to 40,000 times further away.
"""

TRUTH_FLOOR = 1e-10
"""Errors below this are round-off; the fit of an order leaves them out.

Source: the truth of a case is exact to 1e-11; methods that choose their own substeps stop at about 3e-11.
"""

FEWEST = 3
"""The fewest points to which a slope is fitted."""

SAMPLES = 5
"""The number of times at which a run is compared with the truth, the last at its end."""

ORDER = 4.0
"""The order of the methods that the exercise asks for, and of our own."""


@dataclass(frozen=True)
class Truth:
    """The exact motion at every time [s] at which a trajectory is compared with it. `solve` returns it, and caches it;
    it raises ValueError where the scene has constraints."""

    times_s: tuple[float, ...]
    solve: Callable[[], Trajectory]

    def measure_error(self, run: Run, trajectory: Trajectory) -> float:
        """Returns the largest distance at the run's sample times; inf where the trajectory ended early. Raises
        ValueError where the scene has constraints."""
        rows = choose_rows(run)
        here = np.searchsorted(self.times_s, list_sample_times(run))
        return compare(run, trajectory.take(rows[rows < len(trajectory)]), self.solve().take(here)).worst


def coarsen(run: Run) -> tuple[Run, float]:
    """Returns the run with half as many steps, and the factor by which a fourth-order error is larger there. Returns
    the run itself, and 1, where its steps cannot be halved."""
    half = run.steps // 2
    if run.steps % 2 or half < SAMPLES:
        return run, 1.0
    return with_timestep(run, 2 * run.timestep_s, half), 2**ORDER


def choose_rows(run: Run) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """Returns the rows of a trajectory that are compared with the truth."""
    return np.array([round(run.steps * (i + 1) / SAMPLES) for i in range(SAMPLES)]) - 1


def list_sample_times(run: Run) -> tuple[float, ...]:
    """Returns the times [s] of the sampled rows."""
    return tuple(round((row + 1) * run.timestep_s, 12) for row in choose_rows(run).tolist())


@dataclass(frozen=True)
class RunOutcome:
    """The outcome of one case. The errors against the truth are measured only where they may decide."""

    problem: Problem
    student: Trajectory
    truth: Truth

    @property
    def run(self) -> Run:
        """The case's run."""
        return self.problem.run

    @cached_property
    def difference(self) -> Difference:
        """The difference from MuJoCo's method."""
        return compare(self.run, self.student, simulate_mujoco(self.run))

    @cached_property
    def agrees(self) -> bool:
        """Whether every position, velocity and activation agrees with MuJoCo's method at every step."""
        return self.difference.worst <= self.problem.tolerance

    @cached_property
    def is_near_truth(self) -> bool:
        """Whether the run is as near to the truth as a fourth-order method; False where that does not count."""
        if not self.problem.accepts_other_methods or self.agrees:
            return False
        if self.error > 2 * NEARNESS * self.truth.measure_error(self.run, simulate_mujoco(self.run)) + TRUTH_FLOOR:
            return False  # saves the simulation of our own method, which is no further from the truth than MuJoCo's
        coarse, factor = coarsen(self.run)
        ours = self.truth.measure_error(coarse, simulate_fourth_order(coarse)) / factor
        return self.error <= NEARNESS * ours + TRUTH_FLOOR

    @cached_property
    def error(self) -> float:
        """The distance from the truth."""
        return self.truth.measure_error(self.run, self.student)

    @cached_property
    def keeps_time(self) -> bool:
        """Whether data.time is right after every step of the student's, in a case where that matters."""
        late = self.student.time - simulate_mujoco(self.run).time[: len(self.student)]
        return not self.problem.time_matters or bool(np.all(np.abs(late) <= TIME_ROUNDING_S))

    @cached_property
    def is_right(self) -> bool:
        """Whether the case counts."""
        return self.keeps_time and (self.agrees or self.is_near_truth)

    @cached_property
    def first_departure(self) -> int | None:
        """The first step whose difference exceeds the tolerance, counted from 1."""
        over = np.flatnonzero(self.difference.by_step > self.problem.tolerance)
        return int(over[0]) + 1 if len(over) else None


@dataclass(frozen=True)
class OrderOutcome:
    """The errors on the first case at every timestep, and the order that they show. `ignores_timestep`: the states
    after each step were the same at every timestep. `follows_mujoco`: the run at the largest timestep agrees with
    MuJoCo's method, and such a run may count. `other_timestep`: a timestep [s] and what the step took in its place,
    though it takes others as they are."""

    check: OrderMeasurement
    errors: tuple[float, ...]
    ignores_timestep: bool
    follows_mujoco: bool
    coarsest: Run
    truth: Truth
    other_timestep: tuple[float, float] | None = None

    @cached_property
    def is_finite(self) -> bool:
        """Whether every run stayed finite to its end."""
        return all(isfinite(error) for error in self.errors)

    @cached_property
    def slope(self) -> float | None:
        """The slope of log error over log timestep without errors that are round-off; None where too few are left."""
        points = [
            (h, error) for h, error in zip(self.check.timesteps_s, self.errors, strict=True) if error > TRUTH_FLOOR
        ]
        if not self.is_finite or len(points) < FEWEST:
            return None
        timesteps_s, errors = np.array(points, dtype=np.float64).T
        return float(np.polyfit(np.log(timesteps_s), np.log(errors), 1)[0])

    def is_about(self, order: float) -> bool:
        """Whether the slope is this order."""
        return self.slope is not None and abs(self.slope - order) <= self.check.tolerance

    @cached_property
    def is_fourth(self) -> bool:
        """Fourth order or more, or errors as small as those of a fourth-order method. The size of the errors decides
        where too few are left for a slope, and where it is steeper, as in runs that diverge at the largest timestep."""
        if not self.is_finite or self.ignores_timestep:
            return False
        if self.slope is not None and self.slope < ORDER + self.check.tolerance:
            return self.is_about(ORDER)
        return self.is_accurate

    @cached_property
    def is_accurate(self) -> bool:
        """Whether every error is small enough for a fourth-order method at its timestep."""
        ours = self.truth.measure_error(self.coarsest, simulate_fourth_order(self.coarsest))
        allowed = (NEARNESS * ours * (h / self.coarsest.timestep_s) ** ORDER for h in self.check.timesteps_s)
        return all(error <= most + TRUTH_FLOOR for error, most in zip(self.errors, allowed, strict=True))

    @cached_property
    def is_mujocos(self) -> bool:
        """Whether this is the installed MuJoCo's own method with its order on rotations."""
        return self.follows_mujoco and self.is_about(RK4_ORDER_ON_ROTATIONS)


Rk4Outcome = RunOutcome | OrderOutcome


def judge_run(problem: Problem, truth: Truth, results: Results) -> Judgement[Rk4Outcome]:
    """Compares the run of a case with MuJoCo's method and, where that counts, with the exact motion."""
    outcome = RunOutcome(problem, read_trajectory(results, 0, problem.run), truth)
    message, detail = describe_run(outcome)
    alternative = ", or as near to the truth as a fourth-order method" if problem.accepts_other_methods else ""
    return Judgement(
        passed=outcome.is_right,
        message=message,
        outcome=outcome,
        detail=detail,
        measured={name: round_difference(value) for name, value in outcome.difference.largest.items()},
        expected=f"at most {problem.tolerance:g} from MuJoCo's RK4{alternative}",
    )


def describe_run(outcome: RunOutcome) -> tuple[str, str]:
    """Returns message and detail."""
    worst, many = outcome.difference.worst, outcome.problem.accepts_other_methods
    if not len(outcome.student):
        return "The state is not finite after the first step.", ""
    if not outcome.difference.complete:
        return "The state does not stay finite.", f"It is no longer finite after step {len(outcome.student)}."
    if not outcome.keeps_time:
        return "data.time has the wrong value: advance it by model.opt.timestep in every step.", ""
    if outcome.agrees:
        to_truth = f"; both are {outcome.error:.1e} from the truth" if many else ""
        return "Agrees with MuJoCo's RK4.", f"The largest difference is {worst:.1e}{to_truth}."
    if outcome.is_near_truth:
        near = "nearer to the truth: as near" if RK4_ORDER_ON_ROTATIONS < ORDER else "as near to the truth"
        return (
            f"Not MuJoCo's method, but {near} as a fourth-order method must be.",
            f"It differs by {worst:.1e}; its error is {outcome.error:.1e}.",
        )
    far = f"by {worst:.2g} in all" if isfinite(worst) else "without bound: by huge numbers, or a quaternion of length 0"
    return "Departs from MuJoCo's RK4.", f"It departs at step {outcome.first_departure}, and {far}."


def judge_order(problem: Problem, truth: Truth, results: Results) -> Judgement[Rk4Outcome]:
    """Measures the order. Right are the fourth and, where it counts, that of MuJoCo's method on rotations."""
    assert problem.order is not None
    runs = problem.order_runs
    students = [read_trajectory(results, index, run) for index, run in enumerate(runs)]
    errors = tuple(truth.measure_error(run, student) for run, student in zip(runs, students, strict=True))
    coarsest, student = max(zip(runs, students, strict=True), key=lambda pair: pair[0].timestep_s)
    agrees = problem.accepts_other_methods and (
        compare(coarsest, student, simulate_mujoco(coarsest)).worst <= problem.tolerance
    )
    outcome = OrderOutcome(
        problem.order, errors, is_timestep_ignored(students), agrees, coarsest, truth,
        find_other_timestep(runs, students)
    )  # fmt: skip
    return Judgement(
        passed=outcome.is_fourth or outcome.is_mujocos,
        message=describe_order(outcome),
        outcome=outcome,
        detail="" if outcome.slope is None else f"The observed order is {outcome.slope:.2f}.",
        measured=None if outcome.slope is None else round(outcome.slope, 3),
        expected=f"4 within {problem.order.tolerance:g}, or errors as small as those of a fourth-order method",
    )


def is_timestep_ignored(students: Sequence[Trajectory]) -> bool:
    """Whether the states after each step are the same in all runs, and change from step to step."""
    rows = min(map(len, students))
    first, *others = (np.hstack([student.qpos[:rows], student.qvel[:rows]]) for student in students)
    return rows > 1 and not np.all(first == first[0]) and all(np.array_equal(first, other) for other in others)


def find_other_timestep(runs: Sequence[Run], students: Sequence[Trajectory]) -> tuple[float, float] | None:
    """Returns the first timestep [s] at which steps advance the time by another one [s]; None if none or all do."""
    taken = [
        (run.timestep_s, float(student.time[1] - student.time[0]))
        for run, student in zip(runs, students, strict=True)
        if len(student) > 1
    ]
    wrong = [pair for pair in taken if abs(pair[1] / pair[0] - 1) > TIMESTEP_RTOL]
    return wrong[0] if 0 < len(wrong) < len(taken) else None


def describe_order(order: OrderOutcome) -> str:
    """Returns one sentence."""
    if order.is_fourth and order.slope is None:
        return "The errors are too small to measure an order: smaller than those of a fourth-order method."
    if order.is_fourth:
        return (
            f"The error shrinks with {'fourth order' if order.is_about(ORDER) else 'an order as good as the fourth'}."
        )
    if order.is_mujocos:
        return (
            f"The error shrinks with the second order of MuJoCo {INSTALLED}'s own RK4 on rotations; "
            "a method of fourth order there is right too."
        )
    return describe_wrong_order(order)


def describe_wrong_order(order: OrderOutcome) -> str:
    """Returns what is wrong with an order."""
    if order.ignores_timestep:
        return "The state after each step is the same at every timestep: use model.opt.timestep, not a fixed number."
    if order.other_timestep is not None:
        asked_ms, taken_ms = (1e3 * value for value in order.other_timestep)
        return (
            f"At a timestep of {asked_ms:g} ms your step advances data.time by {taken_ms:.4g} ms, although it is right "
            "at other timesteps: use model.opt.timestep as it is, without rounding."
        )
    if order.slope is None:
        why = "it is round-off at some timesteps, large at others" if order.is_finite else "a run did not stay finite"
        return f"The error against the exact motion shows no order: {why}."
    if order.slope > ORDER:
        return "The error shrinks fast, but only because it is far too large at the largest timesteps."
    return "The error does not shrink with fourth order."


def round_difference(value: float) -> float | None:
    """Returns a difference to three figures; None where the run ended early (JSON has no infinity)."""
    return float(f"{value:.3g}") if isfinite(value) else None


def list_accepted_states(problem: Problem) -> list[tuple[float, float]]:
    """Returns the intervals of accepted velocities at the first time at which a trajectory of any method is judged. A
    fixed trajectory that is right in the whole run is right here. The force is drawn from continuous distributions, so
    two draws are far further apart than the tolerance."""
    rows = int(choose_rows(problem.run)[0]) + 1 if problem.accepts_other_methods else 1
    around = max(problem.tolerance, OTHER_METHODS if problem.accepts_other_methods else 0.0)
    early = simulate_mujoco(with_timestep(problem.run, problem.run.timestep_s, rows))
    return [(value - around, value + around) for value in early.qvel[-1].tolist()]
