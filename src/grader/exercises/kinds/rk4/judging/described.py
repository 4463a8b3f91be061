"""A trial as plain JSON, for the learner's own machine, and its judgement there."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from grader.exercises.judgement import Judgement, Results
from grader.exercises.kinds.rk4.judging.judge import Truth, judge_order, judge_run
from grader.exercises.kinds.rk4.judging.run import Force, OrderMeasurement, Problem, Run
from grader.exercises.kinds.rk4.judging.trajectory import Trajectory

PARTS = ("time", "qpos", "qvel", "act")


def describe(problem: Problem, truth: Truth) -> dict[str, Any]:
    """Returns what judges the runs of a trial, beside its inputs: with the exact motion where that is needed."""
    needed = problem.asks_order or problem.accepts_other_methods
    exact = truth.solve() if needed else None
    return {
        "case": problem.case,
        "tolerance": problem.tolerance,
        "time_matters": problem.time_matters,
        "accepts_other_methods": problem.accepts_other_methods,
        "order": vars(problem.order) if problem.asks_order and problem.order else None,
        "times_s": list(truth.times_s) if needed else [],
        "exact": None if exact is None else {name: getattr(exact, name).tolist() for name in PARTS},
    }


def read_order(order: Mapping[str, Any]) -> OrderMeasurement:
    """Returns how the order is measured."""
    return OrderMeasurement(tuple(order["timesteps_s"]), order["tolerance"])


def judge(inputs: Mapping[str, Any], problem: Mapping[str, Any], results: Results) -> Judgement[Any]:
    """Judges the runs of a trial."""
    runs, asks_order = list_runs(inputs), problem["order"] is not None
    posed = Problem(
        case=problem["case"], run=runs[0], tolerance=problem["tolerance"], time_matters=problem["time_matters"],
        accepts_other_methods=problem["accepts_other_methods"], asks_order=asks_order,
        order=read_order(problem["order"]) if asks_order else None, order_runs=runs if asks_order else (),
    )  # fmt: skip
    truth = Truth(tuple(problem["times_s"]), partial(read_motion, problem["exact"], runs[0]))
    return (judge_order if asks_order else judge_run)(posed, truth, results)


def list_runs(inputs: Mapping[str, Any]) -> tuple[Run, ...]:
    """Returns the runs that a driver is asked to make."""
    start: dict[str, Any] = {name: tuple(values) for name, values in inputs["start"].items()}
    force = Force(**{name: freeze(value) for name, value in inputs["force"].items()})
    return tuple(Run(xml=inputs["model"], **start, force=force, **run) for run in inputs["runs"])


def freeze(value: Any) -> Any:
    """Returns nested lists as tuples, which can be hashed."""
    return tuple(map(freeze, value)) if isinstance(value, list | tuple) else value


def read_motion(exact: Mapping[str, Any], run: Run) -> Trajectory:
    """Returns the exact motion; a part without columns has as many rows as the others."""
    rows = len(exact["time"])
    widths = (len(run.qpos), len(run.qvel), len(run.act))
    parts = (np.reshape(exact[name], (rows, width)) for name, width in zip(PARTS[1:], widths, strict=True))
    return Trajectory(np.array(exact["time"], dtype=np.float64), *(np.asarray(part, np.float64) for part in parts))
