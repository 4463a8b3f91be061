"""Names the mistake that the trace of one wrong run shows, by ordered rules on its tableau, rotations and state."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.rk4.addresses import explain_misplaced, explain_quaternion_length, explain_still_balls
from grader.exercises.kinds.rk4.combinations import Combination, Term
from grader.exercises.kinds.rk4.judging.judge import RunOutcome
from grader.exercises.kinds.rk4.judging.quaternions import find_quaternions
from grader.exercises.kinds.rk4.lines import END, StepPlace
from grader.exercises.kinds.rk4.methods import compute_order, find_name
from grader.exercises.kinds.rk4.mutants.catalogue import MUTANTS, OF_BARE_DATA
from grader.exercises.kinds.rk4.mutants.matching import Match, TakenSteps, find_match
from grader.exercises.kinds.rk4.mutants.turns import explain_turns
from grader.exercises.kinds.rk4.rotations import (
    BODY,
    RIGHT,
    explain_wrong_end,
    explain_wrong_sign,
    find_rule,
)
from grader.exercises.kinds.rk4.sentences.changed_numbers import (
    explain_added_constant,
    explain_clipped_velocities,
    explain_inexact_timestep,
    explain_rounded_slopes,
    explain_rounded_state,
    explain_truncated_slopes,
)
from grader.exercises.kinds.rk4.sentences.coordinates import (
    explain_lost_length,
    explain_one_number,
    explain_reset_start,
    explain_some_coordinates,
)
from grader.exercises.kinds.rk4.sentences.slopes import explain_early_calls, explain_slopes, follows_classical, is_close
from grader.exercises.kinds.rk4.sentences.states import (
    FRACTIONS_OF_TIME,
    explain_activations,
    explain_idle,
    explain_missing_slope,
    explain_other_data,
    explain_own_timestep,
    explain_restored_state,
    explain_shared_sum,
    explain_single_joints,
    explain_stale_variables,
    explain_time,
    explain_unreadable_state,
)
from grader.exercises.kinds.rk4.sentences.tableaus import STAGES
from grader.exercises.kinds.rk4.step_trace import read_steps
from grader.exercises.kinds.rk4.tableau import (
    CLASSICAL,
    COEFFICIENT_ATOL,
    Matrix,
    Reading,
    Rule,
    is_same,
    is_same_row,
    read_tableau,
    to_matrix,
)
from grader.exercises.rules import find_sentence
from grader.exercises.trace import Trace, get_list
from grader.numerics.version import RK4_ORDER_ON_ROTATIONS

MUJOCO_MOVES_ONCE = RK4_ORDER_ON_ROTATIONS == 2
"""Whether MuJoCo's RK4 itself moves rotations once, by the weighted mean of the velocities."""

TIMESTEP = "model.opt.timestep"

LOOP_STEPS = 1.5
"""Timesteps that one call of a step moves data.time on at least if it loops."""

HARMLESS_FIELDS = frozenset({"model.opt.integrator"})
"""Fields that no call of mj_forward reads."""

AnyJudged = JudgedTrial[Any, Any]

NO_NUMBER = (
    "In your first step data.qpos or data.qvel becomes nan: None, or something that is no number, was assigned to it. "
    "Functions such as mj_integratePos write into the array that they are given, and return None."
)


NOTHING_HIDDEN = (
    "In a hidden case your step changes nothing in data, and never calls mj_forward: it may end early where the model "
    "is another than you expect. Step every model in the same way."
)

LOOPS = (
    "One call of your step moves data.time on by {steps:.4g} timesteps: take one step of model.opt.timestep in a call, "
    "and leave the loop to the caller."
)

ONLY_ONCE = (
    "Your step does something in its first call, and nothing in later ones: it keeps something from one call to the "
    "next, such as a cache, or ends early by a condition. Take a step in every call."
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
    """The sentence that names a mistake, and the `fallback` that says how far the step can be read. `place` is where
    the step first differs from the right one."""

    sentence: str | None = None
    fallback: str | None = None
    place: StepPlace | None = None


@lru_cache(maxsize=16)
def read_judged_run(judged: JudgedTrial[Any, Any]) -> Reading | None:
    """Reads the tableau off the trace of a judged run; None where there is no trace, or it cannot be read."""
    run = judged.judgement.outcome.run
    try:
        return read_tableau(run.scene().model, read_steps(judged.trace, run))
    except np.linalg.LinAlgError:
        return None


def diagnose_run(failed: Sequence[AnyJudged]) -> Diagnosis:
    """Diagnoses the first of the failed runs by its trace, with a mistake that explains all of them if there is one. An
    empty diagnosis where there is no trace, or it cannot be read."""
    judged = failed[0]
    reading = read_judged_run(judged)
    if reading is None:
        return Diagnosis(NO_NUMBER if begins_with_nan(judged.trace) else None, explain_other_steppers(judged.trace))
    return diagnose_reading(judged.judgement.outcome, failed, reading)


def diagnose_passed_run(passed: AnyJudged) -> Diagnosis:
    """Diagnoses a step by a run that passed, where others have failed: the steps from drawn states show what a run from
    one start hides."""
    reading = read_judged_run(passed)
    if reading is None:
        return Diagnosis()
    return Diagnosis(find_sentence(STATE_RULES, reading) or explain_changed_model(passed))


def begins_with_nan(trace: Trace) -> bool:
    """Whether the very first step asks mj_forward at, or ends in, a state that holds nan."""
    first = next(iter(trace.list_notes("step")), None)
    return first is not None and bool(np.isnan(first.numbers).any())


def diagnose_reading(outcome: RunOutcome, failed: Sequence[AnyJudged], reading: Reading) -> Diagnosis:
    """Diagnoses a wrong run whose trace has been read. A step of four calls whose stages are all sums of its slopes is
    named by its tableau. Of any other a mutant tells more: the tableau takes every call for a stage."""
    judged = failed[0]
    other_steppers = explain_other_steppers(judged.trace)
    if other_steppers == OTHER_STEPPERS["scipy.integrate"]:
        return Diagnosis(other_steppers)  # calls of mj_forward came from there: they are no stages of the student's
    if does_nothing(reading) and (sentence := explain_later_calls(judged)):
        return Diagnosis(sentence)
    sentence = find_sentence(STATE_RULES, reading) or explain_changed_model(judged)
    if judged.hidden and does_nothing(reading):
        sentence = NOTHING_HIDDEN
    if sentence is not None:
        return Diagnosis(sentence)
    if find_quaternions(reading.model) and reading.calls:
        sentence = explain_rotations(reading, outcome, hidden=judged.hidden)
    else:
        sentence = explain_slopes(reading, judged.trace.returned_values)
    if sentence and (is_whole_tableau(reading) or sentence == explain_early_calls(reading)):
        return Diagnosis(add_rest(sentence, failed), place=find_first_difference(reading))
    rest = explain_rest(reading, outcome) if follows_classical(reading) else None
    taken = [steps for trial in failed if (steps := list_taken_steps(trial))]
    match = find_match(taken, OF_BARE_DATA if rest else MUTANTS) if taken else None
    if match and match.mutants and not (sentence and is_better_told_by_tableau(match, reading)):
        more = "" if match.explains_all else " There is more: this does not explain every failed case."
        return Diagnosis(match.sentence + more, place=find_mutant_place(match))
    sentence = sentence or add_second(rest, failed[1:])
    fallback = other_steppers or find_sentence(FALLBACK_RULES, reading)
    return Diagnosis(sentence, fallback, find_first_difference(reading))


def does_nothing(reading: Reading) -> bool:
    """Whether a step never calls mj_forward and leaves the state as it is."""
    rows = (reading.positions, reading.velocities, reading.activations, reading.times)
    return not reading.calls and all(row == {} for part in rows for row in part)


def explain_later_calls(judged: AnyJudged) -> str | None:
    """Returns the sentence of a step most of whose calls do nothing, while the first did."""
    steps = next((float(note.numbers[0]) for note in judged.trace.list_notes("long") if len(note.numbers) == 1), 0.0)
    if LOOP_STEPS < steps < np.inf:
        return LOOPS.format(steps=steps)
    acts = any(step.calls for step in read_steps(judged.trace, judged.judgement.outcome.run))
    return ONLY_ONCE if acts else None


def is_better_told_by_tableau(match: Match, reading: Reading) -> bool:
    """Whether the sentence of the tableau says more than mutants do: they do not explain all runs, are tableaus
    themselves, or are two in a step of one or two calls, which is another method."""
    is_other_method = len(match.mutants) > 1 and reading.calls < STAGES - 1
    return not match.explains_all or match.is_tableau or is_other_method


def add_second(first: str | None, others: Sequence[AnyJudged]) -> str | None:
    """Returns a sentence on the rest of the state, with that on another failed run where it is another mistake."""
    for trial in others if first else ():
        reading = read_judged_run(trial)
        if reading is not None and follows_classical(reading):
            second = explain_rest(reading, trial.judgement.outcome)
            if second is not None and second != first:
                return f"Two things are wrong. First: {first} Second: {second}"
    return first


def add_rest(sentence: str, failed: Sequence[AnyJudged]) -> str:
    """Returns the sentence on positions and velocities, with that on activations or a time which are wrong in another
    way."""
    time_matters = any(trial.judgement.outcome.problem.time_matters for trial in failed)
    for judged in failed:
        reading = read_judged_run(judged)
        velocities = None if reading is None else to_matrix(reading.velocities, "a")
        if reading is None or velocities is None:
            continue
        rest = explain_activations(replace(reading, activations=list_own_activations(reading)))
        if rest is None and time_matters and moves_time_apart(reading, velocities):
            rest = explain_time(reading)
        if rest is not None:
            return f"{sentence} Apart from that: {rest}"
    return sentence


def list_own_activations(reading: Reading) -> Sequence[Combination]:
    """Returns the rows of the activations, with the classical one in place of each that is wrong as positions or
    velocities are; none where a row cannot be read."""
    rows = to_matrix(reading.activations, "r") if reading.activations else None
    others = [to_matrix(reading.positions, "v"), to_matrix(reading.velocities, "a")]
    return [
        get_classical("r", index, reading.calls)
        if any(other is not None and is_same_row(other[index], row) for other in others)
        else {Term("r", stage): share for stage, share in enumerate(row, 1) if share}
        for index, row in enumerate(rows or ())
    ]


def moves_time_apart(reading: Reading, velocities: Matrix) -> bool:
    """Whether the time at some stage is not that to which the stage's velocities have moved."""
    times = [None if row is None else row.get(Term("t", 0), 0.0) for row in reading.times]
    moved = [*map(sum, velocities[:-1]), 1.0]
    return any(time is None or abs(time - right) > COEFFICIENT_ATOL for time, right in zip(times, moved, strict=True))


def is_whole_tableau(reading: Reading) -> bool:
    """Whether a step moves positions and velocities by sums of its slopes alone: by the same, if it has not four calls.
    One in which a call is left out moves them by different ones."""
    positions, velocities = to_matrix(reading.positions, "v"), to_matrix(reading.velocities, "a")
    if positions is None or velocities is None:
        return False
    return reading.calls == STAGES or is_same(positions, velocities)


def list_taken_steps(judged: AnyJudged) -> TakenSteps | None:
    """Returns the steps in the trace of a judged run, with their forces; None if there are none."""
    problem, reading = judged.problem, read_judged_run(judged)
    if reading is None or not all(step.calls for step in reading.steps):
        return None
    forces = {False: problem.run.force, True: problem.probe.force if problem.probe else problem.run.force}
    return TakenSteps(reading.model, [(step, forces[step.probe]) for step in reading.steps])


def find_mutant_place(match: Match) -> StepPlace:
    """Returns where the first of the mutants changes the right step."""
    name, part = match.mutants[0].place
    calls = [all(called) for called in zip(*(mutant.program.calls for mutant in match.mutants), strict=True)]
    after = END if name == "end" else sum(calls[: int(name.removeprefix("stage ")) - 1])
    return StepPlace(after, part, sum(calls))


def find_first_difference(reading: Reading) -> StepPlace | None:
    """Returns the first row of a reading that is not that of the classical method; None if all are. As the sentences
    do, it looks at positions and velocities before activations, and at the time last."""
    positions, velocities = ("qpos", "v", reading.positions), ("qvel", "a", reading.velocities)
    for parts in ((positions, velocities), (("act", "r", reading.activations),), (("time", "t", reading.times),)):
        for row in range(reading.calls + 1):
            for name, slope, rows in parts:
                if rows and (
                    rows[row] is None or not is_close(rows[row] or {}, get_classical(slope, row, reading.calls))
                ):
                    return StepPlace(row if row < reading.calls else END, name, reading.calls)
    return None


def get_classical(slope: str, row: int, calls: int) -> dict[Term, float]:
    """Returns the combination of a row of the classical method, row `calls` for the end of the step."""
    if slope == "t":
        share = FRACTIONS_OF_TIME[min(row, STAGES)]
        return {Term("t", 0): share} if share else {}
    known = CLASSICAL[row if row < calls else -1] if row < len(CLASSICAL) else ()
    return {Term(slope, stage): share for stage, share in enumerate(known, 1) if share}


def explain_changed_model(judged: AnyJudged) -> str | None:
    """Returns the sentence of a step that changes the model that it is given; None if it does not, or harmlessly."""
    note = next(iter(judged.trace.list_notes("changed")), None)
    names = [name for name in get_list(note.info, "fields") if isinstance(name, str)] if note else []
    if note is None or not set(names) - HARMLESS_FIELDS:
        return None
    if TIMESTEP in names and len(note.numbers) == 1 and np.isfinite(note.numbers[0]):
        return (
            f"Your step changes the model that it is given: after the first call {TIMESTEP} is "
            f"{note.numbers[0]:.2g} times what it was, so that every later step has another length. Compute with a "
            "number of your own, h = model.opt.timestep, and leave the model as it is."
        )
    return (
        f"Your step changes the model that it is given: {' and '.join(names)} {'is' if len(names) == 1 else 'are'} not "
        "as before after the first call. Every later step is that of another model: leave it as it is."
    )


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
    if not (alike and (fourth or is_same(velocities, CLASSICAL))) and (
        sentence := explain_still_balls(model, reading.steps) or explain_slopes(reading)
    ):
        return sentence
    rule = find_rule(model, reading.steps, velocities)
    if rule is not None and rule not in RIGHT:
        return rule
    if rule == BODY and alike and not (is_same(velocities, CLASSICAL) and MUJOCO_MOVES_ONCE):
        return describe_single_move(velocities)
    sentence = explain_misplaced(model, reading.steps, velocities, hidden=hidden)
    if sentence is not None or rule not in RIGHT:
        sentence = sentence or explain_wrong_sign(model, reading.steps, velocities)
        return sentence or explain_turns(model, reading.steps, velocities)
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
    explain_inexact_timestep, explain_other_data, explain_reset_start, explain_stale_variables, explain_idle,
    explain_single_joints, explain_restored_state, explain_one_number, explain_some_coordinates,
    explain_clipped_velocities, explain_truncated_slopes, explain_rounded_state, explain_rounded_slopes,
)  # fmt: skip
"""Mistakes in how a step keeps its state and slopes, which are looked for before those of the method."""

FALLBACK_RULES: tuple[Rule, ...] = (
    explain_lost_length, explain_added_constant, explain_missing_slope, explain_shared_sum, explain_own_timestep,
    explain_unreadable_state,
    explain_rotation_end,
)  # fmt: skip
"""True sentences about a step whose mistake is not recognised."""
