"""The film of a judged step: the student's motion beside MuJoCo's, with their distance."""

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from grader.exercises.film import Distance, Film, Panel, choose_rows
from grader.exercises.kind import JudgedTrial, Trial
from grader.exercises.kinds.rk4.judging.judge import Rk4Outcome, RunOutcome
from grader.exercises.kinds.rk4.judging.run import Problem
from grader.exercises.kinds.rk4.judging.trajectory import simulate_mujoco

FIGURES = 6
"""Figures of the positions that are kept: more than can be seen."""


class RecordedMotion(BaseModel):
    """Some positions of the student's run, as the evidence has them: after which steps, from 0, and what they are."""

    case: str
    steps: list[int] = Field(min_length=1)
    qpos: list[list[float]]
    ended: bool = False


class MeasuredDifference(BaseModel):
    """The difference in position against time [s], as the evidence has it."""

    case: str
    tolerance: float
    time_s: list[float]
    qpos: list[float | None]


def keep_motion(visible: Sequence[JudgedTrial[Problem, Rk4Outcome]]) -> dict[str, Any]:
    """Returns `motion`, the student's positions in the wrong visible case that is furthest off, at as many steps as a
    film has frames; nothing where there is none."""
    wrong = [
        outcome
        for outcome in (trial.judgement.outcome for trial in visible)
        if isinstance(outcome, RunOutcome) and not outcome.is_right and len(outcome.student)
    ]
    if not wrong:
        return {}
    outcome = max(wrong, key=lambda candidate: candidate.difference.worst)
    rows = choose_rows(len(outcome.student))
    positions = outcome.student.qpos[rows]
    is_finite = np.isfinite(positions).all(axis=1)
    rows, positions = rows[is_finite], positions[is_finite]
    motion = {
        "case": outcome.problem.case,
        "steps": (rows + 1).tolist(),
        "qpos": [[float(f"{value:.{FIGURES}g}") for value in row] for row in positions.tolist()],
        "ended": not outcome.difference.complete,
    }
    return {"motion": motion} if len(rows) else {}


def record_films(trials: Sequence[Trial[Problem]], evidence: Mapping[str, Any]) -> Iterator[Film]:
    """Yields the film of the motion that the evidence has, beside MuJoCo's RK4 under the same force."""
    try:
        motion = RecordedMotion.model_validate(evidence.get("motion"))
        differences = [
            MeasuredDifference.model_validate(difference) for difference in evidence.get("differences") or []
        ]
    except (ValidationError, TypeError):
        return
    trial = next((candidate for candidate in trials if candidate.id == motion.case), None)
    measured = next((difference for difference in differences if difference.case == motion.case), None)
    if trial is None or measured is None:
        return
    run = trial.problem.run
    theirs = np.array(motion.qpos, dtype=np.float64)
    if theirs.shape != (len(motion.steps), len(run.qpos)) or not 0 < max(motion.steps) <= run.steps:
        return
    ours = simulate_mujoco(run).qpos
    start = np.array(run.qpos)
    mine = np.array(motion.steps)
    whole = choose_rows(run.steps) + 1
    times: list[NDArray[np.float64]] = [np.concatenate([[0], steps]) * run.timestep_s for steps in (mine, whole)]
    ended = f"not finite after {times[0][-1]:.3g} s" if motion.ended else ""
    yield Film(
        "motion",
        "Your step beside MuJoCo's RK4",
        describe_distance(measured),
        run.scene(),
        run.steps * run.timestep_s,
        (
            Panel("Your step", times[0], np.vstack([start, theirs]), ended=ended, behind=1),
            Panel("MuJoCo's RK4", times[1], np.vstack([start, ours[whole - 1]]), integrator="RK4"),
        ),
        Distance("distance in position", measured.tolerance, measured.time_s, measured.qpos),
        steps=run.steps,
    )


def describe_distance(measured: MeasuredDifference) -> str:
    """Says how far the two motions are apart, and whether it can be seen."""
    values = [value for value in measured.qpos if value is not None and isfinite(value)]
    largest = max(values, default=0.0)
    seen = "" if largest > 0.01 else " That is too small to see in the pictures; the curve shows it."
    return f"Under the same force, the positions come to differ by {largest:.2g} (rad or m).{seen}"
