"""Puts together what the trace of one wrong run shows: tableau, rotations, activations, time."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from grader.exercises.kind import Judged
from grader.exercises.kinds.rk4.addresses import misplaced, of_other_length
from grader.exercises.kinds.rk4.judge import RunOutcome
from grader.exercises.kinds.rk4.methods import name_of, order_of
from grader.exercises.kinds.rk4.recorded import read_steps
from grader.exercises.kinds.rk4.rotations import BODY, RIGHT, ends_elsewhere, rule_of, spins_of, wrong_sign
from grader.exercises.kinds.rk4.sentences import explain, follows_classical
from grader.exercises.kinds.rk4.stages import STAGES
from grader.exercises.kinds.rk4.states import (
    agrees_until,
    back_at_the_start,
    cut_off,
    explain_activations,
    explain_idle,
    explain_time,
    kept,
    one_by_one,
    one_sum,
    other_data,
    own_length,
    rounded,
    whole_numbers,
    without_slope,
)
from grader.exercises.kinds.rk4.tableau import CLASSICAL, Matrix, Reading, plain, read_tableau, same
from grader.exercises.trace import Trace, list_in
from grader.numerics.version import RK4_ORDER_ON_ROTATIONS

MUJOCO_MOVES_ONCE = RK4_ORDER_ON_ROTATIONS == 2
"""Whether MuJoCo's RK4 itself moves rotations once, by the weighted mean of the velocities."""

NO_NUMBER = (
    "In your first step data.qpos or data.qvel becomes nan: None, or something that is no number, was assigned to it. "
    "Functions such as mj_integratePos write into the array that they are given, and return None."
)


OTHERS = {
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
class Told:
    """What a trace shows of a mistake: a sentence that names it, or one that says up to where the step can be read."""

    sentence: str | None = None
    fallback: str | None = None


@lru_cache(maxsize=4)
def reading_of(judged: Judged[Any, Any]) -> Reading | None:
    """Returns what the trace of a judged run holds; None where there is no trace, or it cannot be read."""
    run = judged.judgement.outcome.run
    with np.errstate(all="ignore"):  # forged numbers
        try:
            return read_tableau(run.scene().model, read_steps(judged.trace, run))
        except np.linalg.LinAlgError:
            return None


def by_the_trace(outcome: RunOutcome, judged: Judged[Any, Any]) -> Told:
    """Returns what the trace of a wrong run shows; nothing where there is no trace, or it cannot be read."""
    reading = reading_of(judged)
    if reading is None:
        return Told(NO_NUMBER if turns_to_nan(judged.trace) else None, by_others(judged.trace))
    with np.errstate(all="ignore"):
        return told(outcome, judged, reading)


def turns_to_nan(trace: Trace) -> bool:
    """Whether the very first step asks mj_forward at, or ends in, a state that holds nan."""
    first = next(iter(trace.of("step")), None)
    return first is not None and bool(np.isnan(first.numbers).any())


def told(outcome: RunOutcome, judged: Judged[Any, Any], reading: Reading) -> Told:
    """Returns what a reading shows."""
    model = outcome.run.scene().model
    if (
        sentence := other_data(reading)
        or kept(reading)
        or explain_idle(reading, model)
        or one_by_one(reading)
        or back_at_the_start(reading)
        or cut_off(reading)
        or whole_numbers(reading)
        or rounded(reading)
    ):
        return Told(sentence)
    if spins_of(model) and reading.calls:
        sentence = turned_sentence(model, reading, outcome, hidden=judged.trial.hidden)
    else:
        sentence = explain(reading, judged.trace.returned)
    sentence = sentence or (explain_rest(reading, outcome) if follows_classical(reading) else None)
    fallback = by_others(judged.trace) or without_slope(reading, model) or one_sum(reading) or own_length(reading)
    return Told(sentence, fallback or agrees_until(reading) or odd_end(model, reading))


def by_others(trace: Trace) -> str | None:
    """Returns the sentence of a script that may step by something else than mj_forward and its own sums."""
    names = [name for note in trace.of("others") for name in list_in(note.info, "names")]
    return next((sentence for name, sentence in OTHERS.items() if name in names), None)


def odd_end(model: mujoco.MjModel, reading: Reading) -> str | None:
    """Returns the sentence of a step whose quaternions go wrong at its end alone."""
    velocities = plain(reading.velocities, "a")
    if velocities is None or not reading.calls or not spins_of(model):
        return None
    return ends_elsewhere(model, reading.steps, velocities)


def turned_sentence(model: mujoco.MjModel, reading: Reading, outcome: RunOutcome, *, hidden: bool) -> str | None:
    """Returns the sentence of a step on a model with quaternions."""
    velocities = plain(reading.velocities, "a")
    if velocities is None:
        return explain(reading, ())
    positions = plain(reading.positions, "v")
    alike = positions is not None and same(positions, velocities)
    fourth = outcome.problem.accepts_other_methods and order_of(velocities) >= STAGES
    if not (alike and (fourth or same(velocities, CLASSICAL))) and (sentence := explain(reading, ())):
        return sentence
    rule = rule_of(model, reading.steps, velocities)
    if rule is not None and rule not in RIGHT:
        return rule
    if rule == BODY and alike and not (same(velocities, CLASSICAL) and MUJOCO_MOVES_ONCE):
        return moved_once(velocities)
    sentence = misplaced(model, reading.steps, velocities, hidden=hidden)
    return sentence or (
        of_other_length(model, reading.steps) if rule in RIGHT else wrong_sign(model, reading.steps, velocities)
    )


def moved_once(rows: Matrix) -> str:
    """Returns the sentence of a fourth-order tableau whose rotations move once, unless MuJoCo does the same."""
    name = "the classical method" if same(rows, CLASSICAL) else name_of(rows) or "a method of fourth order"
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
    if sentence or not outcome.problem.case.time_matters:
        return sentence
    return explain_time(reading)
