"""Names the mistake that the trace of one wrong run shows, by ordered rules on its tableau, rotations and state."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.rk4.addresses import explain_misplaced, explain_quaternion_length
from grader.exercises.kinds.rk4.judging.judge import RunOutcome
from grader.exercises.kinds.rk4.judging.quaternions import find_quaternions
from grader.exercises.kinds.rk4.methods import compute_order, find_name
from grader.exercises.kinds.rk4.rotations import (
    BODY,
    RIGHT,
    explain_wrong_end,
    explain_wrong_sign,
    find_rule,
)
from grader.exercises.kinds.rk4.slope_sentences import explain_slopes, follows_classical
from grader.exercises.kinds.rk4.state_sentences import (
    explain_activations,
    explain_clipped_velocities,
    explain_idle,
    explain_missing_slope,
    explain_other_data,
    explain_own_timestep,
    explain_restored_state,
    explain_rounded_state,
    explain_shared_sum,
    explain_single_joints,
    explain_stale_variables,
    explain_time,
    explain_truncated_slopes,
    explain_unreadable_state,
)
from grader.exercises.kinds.rk4.step_trace import read_steps
from grader.exercises.kinds.rk4.tableau import CLASSICAL, Matrix, Reading, Rule, is_same, read_tableau, to_matrix
from grader.exercises.kinds.rk4.tableau_sentences import STAGES
from grader.exercises.rules import find_sentence
from grader.exercises.trace import Trace, get_list
from grader.numerics.version import RK4_ORDER_ON_ROTATIONS

MUJOCO_MOVES_ONCE = RK4_ORDER_ON_ROTATIONS == 2
"""Whether MuJoCo's RK4 itself moves rotations once, by the weighted mean of the velocities."""

NO_NUMBER = (
    "In your first step data.qpos or data.qvel becomes nan: None, or something that is no number, was assigned to it. "
    "Functions such as mj_integratePos write into the array that they are given, and return None."
)


OTHER_STEPPERS = {
    "mj_forwardSkip": (
        "Your step calls mj_forwardSkip, which keeps what an earlier call has computed: where it leaves out the "
        "position stage, mass matrix and gravity are those of the state before. Call mj_forward at every stage."
    ),
    "scipy.integrate": (
        "Your step is taken by scipy.integrate, whose functions choose the method, and how many steps they take within "
        "h, by themselves. Write the four stages of one step yourself, with NumPy."
    ),
}
"""The sentence of each name in the note `others`."""


@dataclass(frozen=True)
class Diagnosis:
    """The sentence that names a mistake, and the `fallback` that says how far the step can be read."""

    sentence: str | None = None
    fallback: str | None = None


@lru_cache(maxsize=4)
def read_judged_run(judged: JudgedTrial[Any, Any]) -> Reading | None:
    """Reads the tableau off the trace of a judged run; None where there is no trace, or it cannot be read."""
    run = judged.judgement.outcome.run
    try:
        return read_tableau(run.scene().model, read_steps(judged.trace, run))
    except np.linalg.LinAlgError:
        return None


def diagnose_run(outcome: RunOutcome, judged: JudgedTrial[Any, Any]) -> Diagnosis:
    """Diagnoses a wrong run by its trace; an empty diagnosis where there is no trace, or it cannot be read."""
    reading = read_judged_run(judged)
    if reading is None:
        return Diagnosis(NO_NUMBER if begins_with_nan(judged.trace) else None, explain_other_steppers(judged.trace))
    return diagnose_reading(outcome, judged, reading)


def begins_with_nan(trace: Trace) -> bool:
    """Whether the very first step asks mj_forward at, or ends in, a state that holds nan."""
    first = next(iter(trace.list_notes("step")), None)
    return first is not None and bool(np.isnan(first.numbers).any())


def diagnose_reading(outcome: RunOutcome, judged: JudgedTrial[Any, Any], reading: Reading) -> Diagnosis:
    """Diagnoses a wrong run whose trace has been read."""
    if (sentence := find_sentence(STATE_RULES, reading)) is not None:
        return Diagnosis(sentence)
    if find_quaternions(reading.model) and reading.calls:
        sentence = explain_rotations(reading, outcome, hidden=judged.trial.hidden)
    else:
        sentence = explain_slopes(reading, judged.trace.returned_values)
    sentence = sentence or (explain_rest(reading, outcome) if follows_classical(reading) else None)
    return Diagnosis(sentence, explain_other_steppers(judged.trace) or find_sentence(FALLBACK_RULES, reading))


def explain_other_steppers(trace: Trace) -> str | None:
    """Returns the sentence of a script that may step by something else than mj_forward and its own sums."""
    names = [name for note in trace.list_notes("others") for name in get_list(note.info, "names")]
    return next((sentence for name, sentence in OTHER_STEPPERS.items() if name in names), None)


def explain_rotation_end(reading: Reading) -> str | None:
    """Returns the sentence of a step whose quaternions go wrong at its end alone."""
    velocities = to_matrix(reading.velocities, "a")
    if velocities is None or not reading.calls or not find_quaternions(reading.model):
        return None
    return explain_wrong_end(reading.model, reading.steps, velocities)


def explain_rotations(reading: Reading, outcome: RunOutcome, *, hidden: bool) -> str | None:
    """Returns the sentence of a step on a model with quaternions."""
    model, velocities = reading.model, to_matrix(reading.velocities, "a")
    if velocities is None:
        return explain_slopes(reading)
    positions = to_matrix(reading.positions, "v")
    alike = positions is not None and is_same(positions, velocities)
    fourth = outcome.problem.accepts_other_methods and compute_order(velocities) >= STAGES
    if not (alike and (fourth or is_same(velocities, CLASSICAL))) and (sentence := explain_slopes(reading)):
        return sentence
    rule = find_rule(model, reading.steps, velocities)
    if rule is not None and rule not in RIGHT:
        return rule
    if rule == BODY and alike and not (is_same(velocities, CLASSICAL) and MUJOCO_MOVES_ONCE):
        return describe_single_move(velocities)
    sentence = explain_misplaced(model, reading.steps, velocities, hidden=hidden)
    if sentence is not None or rule not in RIGHT:
        return sentence or explain_wrong_sign(model, reading.steps, velocities)
    return explain_quaternion_length(model, reading.steps)


def describe_single_move(rows: Matrix) -> str:
    """Returns the sentence of a fourth-order tableau whose rotations move once, unless MuJoCo does the same."""
    name = "the classical method" if is_same(rows, CLASSICAL) else find_name(rows) or "a method of fourth order"
    seen = f"This is {name} with one mj_integratePos for all slopes, which is of second order on rotations only."
    if MUJOCO_MOVES_ONCE:
        return (
            f"{seen} MuJoCo does that with the classical weights 1, 2, 2, 1; another method must be of fourth order on "
            "rotations too."
        )
    return (
        f"{seen} Integrate the quaternion's own derivative, quat * (0, omega) / 2, or correct the angular velocity of "
        "each stage for the turn since the start of the step, as MuJoCo does from 4.0.0 on."
    )


def explain_rest(reading: Reading, outcome: RunOutcome) -> str | None:
    """Returns the sentence of activations or a time that are wrong although positions and velocities move rightly."""
    sentence = explain_activations(reading)
    return sentence if sentence or not outcome.problem.time_matters else explain_time(reading)


STATE_RULES: tuple[Rule, ...] = (
    explain_other_data, explain_stale_variables, explain_idle, explain_single_joints, explain_restored_state,
    explain_clipped_velocities, explain_truncated_slopes, explain_rounded_state,
)  # fmt: skip
"""Mistakes in how a step keeps its state and slopes, which are looked for before those of the method."""

FALLBACK_RULES: tuple[Rule, ...] = (
    explain_missing_slope, explain_shared_sum, explain_own_timestep, explain_unreadable_state, explain_rotation_end,
)  # fmt: skip
"""True sentences about a step whose mistake is not recognised."""
