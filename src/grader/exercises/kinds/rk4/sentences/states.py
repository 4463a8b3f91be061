"""Says what is wrong with the rest of a step: activations, time, coordinates that stand still, unknown states."""

from collections.abc import Sequence

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.combinations import Rows, Term, format_coefficient
from grader.exercises.kinds.rk4.judging.quaternions import OFFSETS
from grader.exercises.kinds.rk4.methods import chain_stages_and_result
from grader.exercises.kinds.rk4.sentences.tableaus import FRACTIONS, STAGES, spell_number, write_row
from grader.exercises.kinds.rk4.step_trace import Step
from grader.exercises.kinds.rk4.tableau import (
    CLASSICAL,
    COEFFICIENT_ATOL,
    Matrix,
    Reading,
    is_same,
    is_same_row,
    to_matrix,
)

FRACTIONS_OF_TIME = (0, 1 / 2, 1 / 2, 1, 1)
"""The times of the four stages and of the result, in timesteps from the start of the step."""

CUT_ATOL = 1e-9
"""Relative difference below which two velocities are the same."""


CLOCK_ATOL = 1e-6
"""Difference in timesteps below which two times are the same: a time of many seconds has lost digits."""

LENGTHS_MIN = 3
"""The fewest different lengths of steps that count as the script's own: a fixed one shows two, as the timestep has."""

NUMBERS_MIN = 2
"""The fewest coordinates of which "every" is said."""


SET_TIME = "set it to t, t + h/2, t + h/2 and t + h before the four calls of mj_forward, and to t + h at the end"


def explain_time(reading: Reading) -> str | None:
    """Returns the sentence of a step that keeps data.time wrong; None if it is right, or has not four stages."""
    times = [row.get(Term("t", 0), 0.0) for row in reading.times if row is not None and set(row) <= {Term("t", 0)}]
    if len(reading.times) != STAGES + 1:
        return None
    if any(row and Term("t", 0, 0) in row for row in reading.times):
        return f"Your data.time is counted from 0 in every step, not from the step's start: {SET_TIME}."
    if follows_own_clock(reading):
        return (
            "In your first stage data.time is not the time at which the step began, but that of a clock or counter of "
            "your own, which goes on from one simulation to the next: begin every step with t = data.time."
        )
    if len(times) != len(reading.times):
        return f"Your data.time does not move by fractions of model.opt.timestep: {SET_TIME}."
    return explain_stage_times(times[:-1], times[-1])


def follows_own_clock(reading: Reading) -> bool:
    """Whether times move as they should within each step, but do not all begin at data.time."""
    offsets = [step.time[1] - step.time[0] for step in reading.steps]
    shares = [(step.time[1:] - step.time[1]) / step.timestep_s for step in reading.steps]
    return any(abs(offset) > CUT_ATOL for offset in offsets) and all(
        np.allclose(share, FRACTIONS_OF_TIME, rtol=0, atol=CLOCK_ATOL) for share in shares
    )


def explain_stage_times(stages: Sequence[float], result: float) -> str | None:
    """Returns the sentence of wrong times of the stages and the result, in timesteps; None if they are right."""
    wrong = [i for i, time in enumerate((*stages, result)) if abs(time - FRACTIONS_OF_TIME[i]) > COEFFICIENT_ATOL]
    if not wrong:
        return None
    if not any(stages) and not result:
        return f"data.time does not change: {SET_TIME}."
    if not any(stages):
        return (
            "data.time stands at the start of the step in all four calls of mj_forward: set data.time at every stage "
            "before mj_forward, to t, t + h/2, t + h/2 and t + h."
        )
    if wrong[-1] == STAGES:
        return describe_result_time(result)
    where = write_row((stages[wrong[0]],)).removesuffix(" k1")
    at = "still t" if where == "nothing" else f"t + {where}"
    return f"data.time is {at} when stage {wrong[0] + 1} is evaluated: {SET_TIME}."


def describe_result_time(result: float) -> str:
    """Returns the sentence of a wrong time after the step, in timesteps."""
    if not result:
        return "data.time is put back to the start of the step at its end: advance it by model.opt.timestep."
    why = ": it adds up over the stages. Keep t, and " if result > 1 else ": "
    return f"data.time advances by {format_coefficient(result)} h in a step{why}{SET_TIME}."


def explain_activations(reading: Reading) -> str | None:
    """Returns the sentence of controls or activations that are wrong; None if they are right, or there are none."""
    if any(np.any(step.ctrl != step.ctrl[0]) for step in reading.steps):
        return (
            "data.ctrl differs in your calls of mj_forward from before the step: data.ctrl must still be set when "
            "you call mj_forward. Do not reset data; if you step a data of your own, copy ctrl into it."
        )
    if not reading.activations:
        return None
    rows = to_matrix(reading.activations, "r")
    if rows is None:
        return explain_unreadable_activations(reading)
    if is_same(rows, CLASSICAL) or len(rows) != STAGES + 1:
        return None
    if is_same(rows, chain_stages_and_result(CLASSICAL)):
        return (
            "The activations are not restored between the stages: your variable aliases data.act, so copy it "
            "(data.act.copy())."
        )
    return explain_still_activations(rows) or describe_activation_stage(rows)


def explain_unreadable_activations(reading: Reading) -> str | None:
    """Returns the sentence of the first activations that are no combination of act_dot; None if all are."""
    unknown = next((row for row, activation in enumerate(reading.activations) if activation is None), None)
    if unknown is None:
        return None
    moves = np.any([np.any(step.act != step.act[0], axis=0) for step in reading.steps], axis=0)
    should = np.any([np.any(step.rate, axis=0) for step in reading.steps], axis=0)
    if np.any(moves) and np.any(should & ~moves):
        return (
            "Some activations never change, while others do: data.act has model.na entries, which is not the number of "
            "joints. Advance the whole of data.act[:] with data.act_dot[:]."
        )
    where = f"In your stage {unknown + 1}" if unknown < reading.calls else "At the end of your step"
    return (
        f"{where} data.act cannot be read as its value at the start of the step plus multiples of h times "
        "data.act_dot: take its slope from data.act_dot, as mj_forward leaves it, and change data.act in no other way."
    )


def explain_still_activations(rows: Matrix) -> str | None:
    """Returns the sentence of activations that do not move with the stages, or by one slope alone."""
    *stages, result = rows
    moves = any(map(np.any, stages))
    if not np.any(result):
        if moves:
            return "data.act is put back to the start of the step at its end: write its weighted sum too."
        return "data.act does not change: advance it with data.act_dot, as you advance qvel with qacc."
    if is_same_row(result, (1,)):
        return (
            "data.act advances by Euler's method, with the first act_dot alone: it is a state like qvel, so take "
            "act_dot at every stage, with weights 1, 2, 2, 1 over 6."
        )
    if is_same_row(result, (0, 0, 0, 1)):
        return (
            "data.act advances with the last act_dot alone: data.act_dot is a view that the next mj_forward "
            "overwrites, so copy it."
        )
    if not moves:
        return (
            "data.act stands at the start of the step in all your stages: write it before every mj_forward, moved by "
            "the act_dot of the stage before."
        )
    return None


def describe_activation_stage(rows: Matrix) -> str:
    """Returns the sentence of the first wrong stage, or of wrong weights."""
    wrong = next((i for i, row in enumerate(rows, 1) if not is_same_row(row, CLASSICAL[i - 1])), len(rows))
    moves = write_row(rows[wrong - 1], "act_dot")
    if wrong > STAGES:
        return f"data.act moves by {moves}; the weights of the four act_dot are 1, 2, 2, 1 over 6."
    right = f"{FRACTIONS[wrong]} act_dot{wrong - 1}" if wrong in FRACTIONS else "nothing"
    return f"In your stage {wrong}, data.act moves by {moves}; it should move by {right}."


def explain_other_data(reading: Reading) -> str | None:
    """Returns the sentence of steps that ask mj_forward at one and the same state, wherever they begin."""
    steps = reading.steps
    if reading.calls < 2 or all(np.array_equal(step.qpos[0], steps[0].qpos[0]) for step in steps):
        return None
    asked = [np.hstack([step.qpos[row], step.qvel[row]]) for step in steps for row in range(1, step.calls + 1)]
    if any(not np.array_equal(array, asked[0]) for array in asked):
        return None
    return (
        "Every call of mj_forward finds the same state, wherever your step begins: you pass it another data than that "
        "of your step, or reset it. Write the stage's state into the data that you are given, and pass that one."
    )


def explain_missing_slope(reading: Reading) -> str | None:
    """Returns the sentence of a stage that adds the same multiple of h to every position or velocity."""
    model, parts = reading.model, {"velocity": [step.qvel for step in reading.steps]}
    if model.nq == model.nv:
        parts["position"] = [step.qpos for step in reading.steps]
    if model.nv < NUMBERS_MIN or not reading.has_four_calls:
        return None
    for row in range(2, reading.calls + 1):
        for what, states in parts.items():
            shares = [
                (array[row] - array[0]) / step.timestep_s for array, step in zip(states, reading.steps, strict=True)
            ]
            share = shares[0][0]
            if abs(share) > CUT_ATOL and all(np.allclose(known, share, rtol=0, atol=CUT_ATOL) for known in shares):
                return (
                    f"Your stage {row} adds the same number, {write_row((share,)).removesuffix(' k1')}, to every "
                    f"{what}: multiply it by the slope k{row - 1}, one number for each {what}."
                )
    return None


def explain_own_timestep(reading: Reading) -> str | None:
    """Returns the sentence of steps that move by the first slope, but as far as no timestep tells."""
    lengths = []
    for step in reading.steps if reading.calls else ():
        slope, change = step.qacc[1], step.qvel[2] - step.qvel[0]
        share = float(slope @ change) / (float(slope @ slope) or 1.0)
        if share <= 0 or np.max(np.abs(change - share * slope)) > CUT_ATOL * (1 + np.max(np.abs(change))):
            return None
        lengths.append(share / step.timestep_s)
    if len({f"{length:.4g}" for length in lengths}) < LENGTHS_MIN:
        return None
    return (
        "Your steps are not as long as model.opt.timestep: in every call the second stage lies at another distance "
        "from the start. Use h = model.opt.timestep, not the time that has passed on a clock, nor a step size of your "
        "own."
    )


def explain_single_joints(reading: Reading) -> str | None:
    """Returns the sentence of stages that move one coordinate at a time."""
    steps = reading.steps
    if reading.calls < 2 * STAGES or any(step.qvel.shape[1] < NUMBERS_MIN for step in steps):
        return None
    for step in steps:
        moves = np.diff(step.qvel[1:], axis=0) != 0
        if np.any(np.sum(moves, axis=1) > 1) or np.sum(np.any(moves, axis=0)) < NUMBERS_MIN:
            return None
    return (
        "Your step moves one joint at a time: from one call of mj_forward to the next all other joints stand still. "
        "Each acceleration depends on all of them, so move the whole of data.qpos and data.qvel to every stage."
    )


def explain_restored_state(reading: Reading) -> str | None:
    """Returns the sentence of a mj_forward that runs after each stage's state has been put back."""
    for step in reading.steps:
        at_start = [begins_at(step, step, row) for row in range(1, step.calls + 1)]
        if step.calls <= STAGES or all(at_start) or not at_start[-1]:
            return None
        if np.max(np.abs(step.qvel[-1] - step.qvel[0] - step.timestep_s * step.qacc[1])) > CUT_ATOL:
            return None
    return (
        "mj_forward is called again after a stage's state has been put back, so that data.qacc and data.act_dot are "
        "those of the start of the step each time. Copy them right after the call at the stage's state."
    )


def explain_shared_sum(reading: Reading) -> str | None:
    """Returns the sentence of positions and velocities that end with the same change."""
    for step in reading.steps:
        if step.qpos.shape[1] != step.qvel.shape[1]:
            return None
        q, v = step.qpos[-1] - step.qpos[0], step.qvel[-1] - step.qvel[0]
        if not np.any(q) or np.max(np.abs(q - v)) > CUT_ATOL * np.max(np.abs(q)):
            return None
    return (
        "At the end of your step positions and velocities change by the same numbers: their two sums are one array, as "
        "after dq = dv = np.zeros(...), which gives one array two names. Make an array for each."
    )


def explain_stale_variables(reading: Reading) -> str | None:
    """Returns the sentence of steps that begin at a state, or use slopes, of another call; None if none do. One step is
    enough: two states are never the same by chance."""
    steps = reading.steps
    if reading.calls < 2 or len(steps) < 2:
        return None
    elsewhere = [step for step in steps if not begins_at(step, step, 0)]
    pairs = ((step, other) for step in elsewhere for other in steps if other is not step)
    if any(begins_at(step, other, row) for step, other in pairs for row in (0, -1)):
        return (
            "Your step does not begin at the state in data, but at one that an earlier call has left in a variable "
            "outside of the function: copy data.qpos, data.qvel, data.act and data.time at the start of every call."
        )
    stages = not all(moves_with(step, step.qacc[1]) for step in steps) and any(
        all(moves_with(step, one.qacc[1]) for step in steps) for one in steps
    )
    if stages or ends_with_other_slopes(steps):
        return (
            f"The slopes in your {'stages' if stages else 'weighted sum'} are those of an earlier call: a list outside "
            "of the function, to which every call appends, keeps them. Make the list new in every call."
        )
    return None


def ends_with_other_slopes(steps: Sequence[Step]) -> bool:
    """Whether all steps end with the weighted sum of the slopes of one of them, wherever they begin."""
    if any(step.calls != STAGES for step in steps):
        return False
    changes = [(step.qvel[-1] - step.qvel[0]) / step.timestep_s for step in steps]
    sums = [np.array(CLASSICAL[-1]) @ step.qacc[1:] for step in steps]
    return any(all(is_near(change, total) for change in changes) for total in sums) and not all(
        map(is_near, changes, sums)
    )


def is_near(one: Rows, other: Rows) -> bool:
    """Whether two accelerations are the same, but for what the division by h makes of round-off."""
    return bool(np.all(np.abs(one - other) <= CUT_ATOL * (1 + np.abs(other))))


def begins_at(step: Step, other: Step, row: int) -> bool:
    """Whether the first call of a step finds the state in a row of another one (or of itself)."""
    return np.array_equal(step.qpos[1], other.qpos[row]) and np.array_equal(step.qvel[1], other.qvel[row])


def moves_with(step: Step, slope: Rows) -> bool:
    """Whether the velocity of stage 2 lies half a step of this slope from the start."""
    change = step.qvel[2] - step.qvel[0]
    return bool(np.all(np.abs(change - step.timestep_s / 2 * slope) <= CUT_ATOL * (1 + np.max(np.abs(change)))))


def explain_idle(reading: Reading) -> str | None:
    """Returns the sentence of velocities or positions that never change although others do."""
    dofs = int(reading.model.nv)
    idle, still = (part if len(part) < dofs else () for part in (reading.idle, reading.still))
    if not idle and not still:
        return None
    first = min([*idle, *still])
    rest = list(range(first, dofs))
    if first and rest in (list(idle), list(still)):
        move = "one moves" if first == 1 else f"{spell_number(first)} move"
        return (
            f"Some velocities do not change: only the first {move}, and a model may have more joints than you move. "
            "Advance all of data.qpos and data.qvel."
        )
    if not idle and reading.model.nq > dofs:
        if all(np.array_equal(step.qpos[0], row) for step in reading.steps for row in step.qpos[1:]):
            return (
                "No position changes, neither in the stages nor at the end, although the velocities do: write the new "
                "positions into data.qpos[:]. If you loop over the joints, begin with joint 0."
            )
        return describe_still_joint(reading, still)
    what = "velocities" if idle else "positions"
    return f"Some {what} do not change, while others do: advance all of data.qpos and data.qvel."


def describe_still_joint(reading: Reading, still: Sequence[int]) -> str:
    """Returns the sentence of joints whose positions never change although their velocities do."""
    if is_free_joint_first(reading.model, still):
        return (
            "The place of a free joint never changes, although its velocity does: move its first three numbers in "
            "data.qpos by the first three of its velocity. If you loop over the joints, begin with joint 0."
        )
    if are_later_joints_still(reading):
        return (
            "Joints behind the first one with a quaternion never move, although their velocities do: go on with "
            "the loop over the joints after it (no break or return in the loop), and read the place of each joint "
            "from model.jnt_qposadr."
        )
    return (
        "The position of a hinge or slide never changes, although its velocity does: move those as well, at "
        "model.jnt_qposadr[joint], which after a quaternion is neither the joint's number nor its jnt_dofadr."
    )


def are_later_joints_still(reading: Reading) -> bool:
    """Whether two joints or more follow the first one with a quaternion, and no number of theirs ever changes."""
    model = reading.model
    turning = [joint for joint in range(int(model.njnt)) if int(model.jnt_type[joint]) in OFFSETS]
    behind = model.jnt_qposadr[turning[0] + 1 :]
    return len(behind) >= NUMBERS_MIN and not any(
        np.any(step.qpos[:, behind[0] :] - step.qpos[0, behind[0] :]) for step in reading.steps
    )


def is_free_joint_first(model: mujoco.MjModel, still: Sequence[int]) -> bool:
    """Whether the first coordinate that stands still is a free joint's."""
    return int(model.jnt_type[model.dof_jntid[min(still)]]) == int(mujoco.mjtJoint.mjJNT_FREE)


def explain_unreadable_state(reading: Reading) -> str | None:
    """Returns an honest sentence for a step with a state that is no combination of its slopes."""
    if reading.calls == 1 and all(ends_with_its_call(step) for step in reading.steps):
        return (
            "mj_forward is called once, when your step has ended, so that nothing of the step comes from it: call it "
            "at every stage, and take the acceleration from data.qacc, not from formulas of your own."
        )
    if not reading.calls:
        return (
            "Your step never calls mujoco.mj_forward: call it at every stage, after its state is written, and take the "
            "slopes from data.qvel, data.qacc and data.act_dot."
        )
    parts = {"positions": reading.positions, "velocities": reading.velocities}
    for row in range(reading.calls + 1):
        unknown = [name for name, rows in parts.items() if rows[row] is None]
        if unknown:
            return describe_unreadable_row(row, unknown, reading.calls)
    return None


def ends_with_its_call(step: Step) -> bool:
    """Whether the last call of mj_forward finds the state after the step, not that before it."""
    return begins_at(step, step, -1) and not begins_at(step, step, 0)


def describe_unreadable_row(row: int, unknown: Sequence[str], calls: int) -> str:
    """Returns the sentence of the first state that cannot be read: row `row`, `calls` for the end of the step."""
    if row == 1 and "velocities" in unknown and calls > 1:
        return (
            "The velocities in your stage 2 do not follow from data.qacc, as mj_forward left it in stage 1. Take "
            "data.qacc as the slope of the velocities, and nothing else."
        )
    where = f"in your stage {row + 1}" if row < calls else "at the end of your step"
    opening = (
        f"The {' and '.join(unknown)} {where} are not those at the start of the step plus multiples of h times your"
    )
    if calls < STAGES:
        times = "once" if calls == 1 else f"{spell_number(calls)} times"
        return f"{opening} slopes. You call mj_forward {times}; use four slopes of this step, and none of the last one."
    if calls > STAGES:
        return (
            f"{opening} slopes. You call mj_forward {spell_number(calls)} times in a step; the classical step calls it "
            "four times, once for each slope."
        )
    until = f" Your stages up to {row} can be read." if row > 1 else ""
    return f"{opening} slopes.{until} Print that state, and compare it with the formula by hand."
