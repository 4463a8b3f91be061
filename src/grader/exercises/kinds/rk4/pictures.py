"""Pictures of judged steps: the difference against time, and the error against the timestep with its slope."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.rk4.diagnosis import read_judged_run
from grader.exercises.kinds.rk4.films import keep_motion
from grader.exercises.kinds.rk4.judging.judge import OrderOutcome, Rk4Outcome, RunOutcome
from grader.exercises.kinds.rk4.judging.run import Problem
from grader.exercises.kinds.rk4.tableau import draw_tableau

POINTS_MAX = 300


def build_evidence(visible: Sequence[JudgedTrial[Problem, Rk4Outcome]]) -> dict[str, Any]:
    """Returns `differences` of cases (for a logarithmic axis), `order`, the `tableau` of the first case, and of a wrong
    one the `motion`."""
    outcomes = [trial.judgement.outcome for trial in visible]
    order = next((outcome for outcome in outcomes if isinstance(outcome, OrderOutcome)), None)
    return {
        "differences": [draw_difference(outcome) for outcome in outcomes if isinstance(outcome, RunOutcome)],
        "order": draw_order(order) if order else None,
        "tableau": find_tableau(visible),
        **keep_motion(visible),
    }


def find_tableau(visible: Sequence[JudgedTrial[Problem, Rk4Outcome]]) -> dict[str, Any] | None:
    """Returns the tableau in the trace of the first case; None if it is hidden, or no tableau gives its steps."""
    first = next((trial for trial in visible if isinstance(trial.judgement.outcome, RunOutcome)), None)
    reading = read_judged_run(first) if first and first.problem.probe else None
    return draw_tableau(reading) if reading else None


def draw_difference(outcome: RunOutcome) -> dict[str, Any]:
    """Returns time [s] and the size of the differences in position and velocity."""
    rows = len(outcome.difference.qpos)
    chosen = (
        np.unique(np.linspace(0, rows - 1, min(rows, POINTS_MAX)).round().astype(int)) if rows else np.array([], int)
    )
    return {
        "case": outcome.problem.case,
        "tolerance": outcome.problem.tolerance,
        "time_s": round_figures((chosen + 1) * outcome.run.timestep_s),
        "qpos": round_figures(outcome.difference.qpos[chosen]),
        "qvel": round_figures(outcome.difference.qvel[chosen]),
    }


def draw_order(order: OrderOutcome) -> dict[str, Any]:
    """Returns timesteps [ms], errors against the exact motion, their slope; None where a run ended early."""
    return {
        "timestep_ms": [1000 * h for h in order.check.timesteps_s],
        "error": [float(f"{error:.4g}") if isfinite(error) else None for error in order.errors],
        "slope": None if order.slope is None else round(order.slope, 3),
        "expected_slope": 4,
    }


def round_figures(values: NDArray[np.float64]) -> list[float | None]:
    """Returns values to four figures; None for what is not finite."""
    return [float(f"{value:.4g}") if isfinite(value) else None for value in values.tolist()]


def describe_right_step(visible: Sequence[Rk4Outcome]) -> str:
    """Returns sentences on the visible runs of a right step: how far it is from MuJoCo's, and its order."""
    run = next((outcome for outcome in visible if isinstance(outcome, RunOutcome)), None)
    order = next((outcome for outcome in visible if isinstance(outcome, OrderOutcome)), None)
    sentences = []
    if run is not None and run.agrees:
        same = (
            "bit for bit that of MuJoCo's RK4"
            if run.difference.worst == 0
            else (f"within {run.difference.worst:.1g} of MuJoCo's RK4")
        )
        sentences.append(f"After {run.run.steps} steps your state is {same}.")
    elif run is not None:
        sentences.append(
            "Your step is not MuJoCo's own, and as near to the exact motion as a method of fourth order is."
        )
    if order is not None and order.slope is not None:
        sentences.append(f"Your error shrinks with order {order.slope:.2f}.")
    return " ".join(sentences)
