"""Says what is wrong with a step whose trace has been read: first what was seen, then what to do. The sentences hold
the student's own coefficients, and no number of a case. Of RULES the first that returns a sentence counts."""

from collections.abc import Mapping, Sequence

import numpy as np

from grader.exercises.kinds.rk4.combinations import Combination, Term, format_coefficient
from grader.exercises.kinds.rk4.methods import chain_stages, chain_stages_and_result, chain_views
from grader.exercises.kinds.rk4.sentences.changed_numbers import explain_own_drag, explain_powers_of_h
from grader.exercises.kinds.rk4.sentences.tableaus import (
    STAGES,
    describe_method,
    explain_view,
    join_words,
    spell_number,
    write_row,
)
from grader.exercises.kinds.rk4.step_trace import Rows
from grader.exercises.kinds.rk4.tableau import (
    CLASSICAL,
    COEFFICIENT_ATOL,
    SMOOTH,
    STALE,
    Matrix,
    Reading,
    Rule,
    is_same,
    look_up,
    look_up_row,
    to_matrix,
)
from grader.exercises.rules import find_sentence
from grader.exercises.trace import ReturnedValue

Combinations = Sequence[Combination | None]


def explain_slopes(reading: Reading, returned: Sequence[ReturnedValue] = ()) -> str | None:
    """Returns the sentence of the first rule that knows the step; None if none does."""
    sentence = explain_unchanged_state(reading, returned)
    return sentence if sentence or not reading.calls else find_sentence(RULES, reading)


def explain_unchanged_state(reading: Reading, returned: Sequence[ReturnedValue]) -> str | None:
    """Returns the sentence of a step that leaves the state, or a part of it, as it is."""
    q_stays = all(np.array_equal(step.qpos[0], step.qpos[-1]) for step in reading.steps)
    v_stays = all(np.array_equal(step.qvel[0], step.qvel[-1]) for step in reading.steps)
    if q_stays and v_stays:
        return describe_unwritten_state(reading, returned)
    if not reading.calls or not (q_stays or v_stays):
        return None
    moves, stays = ("data.qpos", "data.qvel") if v_stays else ("data.qvel", "data.qpos")
    return (
        f"Your step changes {moves} and leaves {stays} as it was: write the weighted sum of its slopes into {stays}[:] "
        "too."
    )


def describe_unwritten_state(reading: Reading, returned: Sequence[ReturnedValue]) -> str:
    """Returns the sentence of a step after which positions and velocities are as before."""
    if returned and returned[0].type != "NoneType":
        article = "an" if returned[0].type[:1].lower() in "aeiou" or returned[0].type == "ndarray" else "a"
        return (
            f"Your function returns its result ({article} {returned[0].type}) and leaves data as it was: write the new "
            "state into data.qpos[:], data.qvel[:], data.act[:] and data.time; nothing need be returned."
        )
    if reading.calls and any(moves_within(step.qpos) and moves_within(step.qvel) for step in reading.steps):
        return (
            "Your stages move data.qpos and data.qvel, but after your step both are as before: the new values went "
            "into variables of your own (write data.qpos[:] = ...), or the factor of the weighted sum is 0 (in Python "
            "h // 6 is 0, h / 6 is not)."
        )
    if reading.calls:
        times = "once" if reading.calls == 1 else f"{spell_number(reading.calls)} times"
        return (
            f"mj_forward is called {times}, but after your step data.qpos and data.qvel are as before: write the new "
            "state into data.qpos[:] and data.qvel[:]. An assignment without [:] changes your own variable, not data."
        )
    if any(reading.times):
        return (
            "Your step advances data.time and nothing else: take accelerations from mujoco.mj_forward, and advance "
            "data.qpos and data.qvel."
        )
    return (
        "Your step changes nothing in data, and never calls mj_forward: evaluate the four stages, and write their "
        "weighted sum into data."
    )


def moves_within(states: Rows) -> bool:
    """Whether some call of mj_forward was asked at another state than the one before the step; rows as in Step."""
    return any(not np.array_equal(states[0], row) for row in states[1:-1])


def explain_borrowed_slopes(reading: Reading) -> str | None:
    """Returns the sentence of accelerations that are not those of the step's own calls."""
    slopes = {term.slope for row in reading.velocities if row for term in row}
    if STALE in slopes:
        return (
            "Your first acceleration is data.qacc as it stood before the step: nothing has computed it for this state. "
            "Call mj_forward before you read data.qacc."
        )
    if (sentence := explain_own_drag(reading.velocities)) is not None:
        return sentence
    crossed = [
        what
        for what, rows, slope in (("position", reading.positions, "a"), ("velocity", reading.velocities, "v"))
        if any(row and {(term.slope, term.power) for term in row} == {(slope, 1)} for row in rows)
    ]
    if crossed:
        seen = {"position": "Your positions move by accelerations", "velocity": "Your velocities move by velocities"}
        return (
            f"{' and your '.join([seen[crossed[0]], *(seen[what][5:] for what in crossed[1:])])}: the slope of "
            "data.qpos is data.qvel, and the slope of data.qvel is data.qacc. Look where you unpack or sum them."
        )
    if SMOOTH in slopes:
        return (
            "Your accelerations are data.qacc_smooth, which leaves out constraint forces (joint limits, contacts): "
            "use data.qacc."
        )
    return None


def explain_early_calls(reading: Reading) -> str | None:
    """Returns the sentence of calls of mj_forward that run before the state of their stage is written."""
    calls = range(2, reading.calls + 1)
    at_start = [stage for stage in calls if reading.positions[stage - 1] == {} and reading.velocities[stage - 1] == {}]
    if at_start and len(at_start) == len(calls):
        every = "Both" if reading.calls == 2 else f"All {spell_number(reading.calls)}"
        if any(reading.times[1 : reading.calls]):
            return (
                f"{every} calls of mj_forward find the state at the start of the step, although data.time moves: no "
                "slope reaches data.qpos and data.qvel. Print what you add to the start in stage 2: it should be h/2 "
                "k1, and the sum should go into data.qpos[:] and data.qvel[:]."
            )
        return (
            f"{every} calls of mj_forward find the state at the start of the step: write a stage's positions and "
            "velocities into data.qpos[:] and data.qvel[:] before you call it."
        )
    last = reading.velocities[reading.calls - 1]
    if at_start[:1] == [2] and reading.calls == STAGES and last and abs(sum(last.values()) - 1 / 2) <= COEFFICIENT_ATOL:
        return (
            "mj_forward runs before the stage's state is written: its second call finds the start of the step again, "
            "and each later one the stage before. Write data.qpos[:] and data.qvel[:] first, then call it."
        )
    return explain_late_velocities(reading)


def explain_late_velocities(reading: Reading) -> str | None:
    """Returns the sentence of calls of mj_forward that find positions of their stage, velocities of the one before."""
    velocities = to_matrix(reading.velocities, "a")
    if velocities is None or not reading.positions[1] or not is_same([*velocities[:-1], ()], LATE_STAGES):
        return None
    return (
        "In your stages 2, 3 and 4 mj_forward finds the position of the stage, and the velocity of the stage before: "
        "write data.qvel[:] too before you call it."
    )


LATE_STAGES: Matrix = ((), (), (1 / 2,), (0, 1 / 2), ())
"""The stages of velocities that are written after the call."""


def explain_whole_method(reading: Reading) -> str | None:
    """Returns the sentence of a step with one tableau for positions and velocities, other than the classical one."""
    velocities, positions = to_matrix(reading.velocities, "a"), to_matrix(reading.positions, "v")
    if velocities is None or positions is None or not is_same(velocities, positions) or is_same(velocities, CLASSICAL):
        return None
    return describe_method(velocities, "state")


def explain_several_views(reading: Reading) -> str | None:
    """Returns the sentence of starts and slopes that go on changing with data, not the same ones for positions and
    velocities: each of the two looks like a tableau of its own."""
    positions, velocities = to_matrix(reading.positions, "v"), to_matrix(reading.velocities, "a")
    if positions is None or velocities is None:
        return None
    start, last, both = chain_stages_and_result(CLASSICAL), (*CLASSICAL[:-1], (0, 0, 0, 1)), chain_views(CLASSICAL)
    rows = (positions, velocities)
    found = [next((name for name in (CLASSICAL, start, last, both) if is_same(row, name)), None) for row in rows]
    one, other = found
    if one is None or other is None or one is other or (CLASSICAL in found and both not in found):
        return None
    moved = [what for what, kind in zip(("positions", "velocities"), found, strict=True) if kind in (start, both)]
    equal = [what for what, kind in zip(("velocities", "accelerations"), found, strict=True) if kind in (last, both)]
    kept = {"data.qpos": "positions" in moved, "data.qvel": "velocities" in moved + equal,
            "data.qacc": "accelerations" in equal}  # fmt: skip
    return (
        f"Stages 3 and 4 and the weighted sum start from the {join_words(moved)} of the stage before, and all "
        f"{join_words(equal)} in the sum equal the last one: without .copy(), what you keep of "
        f"{join_words([name for name, is_kept in kept.items() if is_kept])} is a view that data goes on changing, so "
        "copy each of them."
    )


def explain_separate_rules(reading: Reading) -> str | None:
    """Returns the sentence of positions and velocities that move by different rules."""
    velocities, positions = to_matrix(reading.velocities, "a"), to_matrix(reading.positions, "v")
    if velocities is None:
        return None
    if is_same(velocities, [*CLASSICAL[:-1], (0, 0, 0, 1)]) and not (positions and is_same(velocities, positions)):
        return (
            "All accelerations equal the last one: data.qacc is a view that the next mj_forward overwrites, so copy it."
            " If you did, the sum uses the last one alone."
        )
    sentence = explain_new_velocity(reading, velocities)
    if sentence or (positions is not None and is_same(velocities, positions)):
        return sentence
    if not is_same(velocities, CLASSICAL):
        return (
            explain_overwritten_velocities(velocities)
            or explain_view(velocities, "qacc")
            or describe_method(velocities, "velocity", positions)
        )
    if positions is not None:
        return (
            explain_position_tableau(positions)
            or explain_view(positions, "qvel")
            or describe_method(positions, "position")
        )
    return explain_mixed_slopes(reading)


def explain_overwritten_velocities(velocities: Matrix) -> str | None:
    """Returns the sentence of velocities that are overwritten, or not written, while they are needed."""
    if is_same(velocities, chain_stages_and_result(CLASSICAL)):
        return "The velocity is not restored between the stages: v aliases data.qvel, so copy it (data.qvel.copy())."
    if is_same(velocities, chain_stages(CLASSICAL)):
        return (
            "The velocity of each of your stages starts from that of the stage before: restore v to the start of the "
            "step before every stage."
        )
    if len(velocities) > 2 and not any(np.any(stage) for stage in velocities[:-1]):
        return (
            f"All {spell_number(len(velocities) - 1)} calls of mj_forward find the velocities of the start of the "
            "step: only the positions of your stages move. Write the stage's velocity into data.qvel[:] too."
        )
    return None


def explain_position_tableau(positions: Matrix) -> str | None:
    """Returns the sentence of positions with a tableau of their own."""
    stages = [*positions[:-1], ()]
    sentence = look_up(positions, POSITION_TABLEAUS) or look_up(stages, POSITION_STAGES)
    if sentence is not None:
        return sentence
    if not is_same(stages, [*CLASSICAL[:-1], ()]):
        return None
    return look_up_row(positions[-1], POSITION_WEIGHTS) or explain_added_acceleration(positions[-1])


def explain_added_acceleration(weights: Sequence[float]) -> str | None:
    """Returns the sentence of a term h h a that is added to the weighted mean: a difference of two stage velocities."""
    first, *more = np.array(weights) - CLASSICAL[-1]
    added = [stage for stage, share in enumerate(more, 1) if abs(share) > COEFFICIENT_ATOL]
    if len(added) != 1 or abs(first + sum(more)) > COEFFICIENT_ATOL or weights[0] > -COEFFICIENT_ATOL:
        return None
    size = format_coefficient(more[added[0] - 1] * CLASSICAL[added[0]][added[0] - 1])
    return (
        f"At the end of your step the position moves by {size} h h a{added[0]} beside the weighted mean of the four "
        "stage velocities: leave that out, for these have moved by the accelerations already."
    )


POSITION_TABLEAUS: Mapping[str, Matrix] = {
    "Your stages move the positions in place, so that each starts from those of the stage before; restore qpos "
    "to the start of the step before every stage.": chain_stages(CLASSICAL),
    "The positions are moved in place by every stage and at the end; restore qpos to the start of the step "
    "before every stage (without .copy(), q is data.qpos itself).": chain_stages_and_result(CLASSICAL),
}
"""Wrong tableaus of the positions alone."""

POSITION_STAGES: Mapping[str, Matrix] = {
    "Your stages all move the position with the velocity at the start of the step; use the velocity of the "
    "stage before.": ((), (1 / 2,), (1 / 2,), (1,), ()),
    "All four calls of mj_forward find the positions of the start of the step: only the velocities of your "
    "stages move. Write the stage's positions into data.qpos[:] too.": ((), (), (), (), ()),
}
"""Wrong stages of the positions alone, with any weights."""

POSITION_WEIGHTS: Mapping[tuple[float, ...], str] = {
    (0, 0, 0, 1): (
        "All stage velocities equal the last one: data.qvel is a view that the next stage overwrites, so copy it. If "
        "you did, the sum uses the last one alone."
    ),
    (1, 0, 0, 0): (
        "The position advances with the velocity at the start of the step alone; use the weighted mean of the four "
        "stage velocities."
    ),
    (0, 1, 0, 0): (
        "The position advances with the velocity of stage 2 alone, which is h v + h h a/2, the formula of constant "
        "acceleration; use the weighted mean of the four stage velocities."
    ),
}
"""Weights of the velocities alone, where velocities and stages are right."""


def explain_new_velocity(reading: Reading, velocities: Matrix) -> str | None:
    """Returns the sentence of positions that move by a new velocity."""
    rows, result = reading.positions, reading.positions[-1]
    if result is None or any(row is None for row in rows):
        return None
    if reading.calls == 1:
        return explain_single_call(result, velocities)
    if is_verlet(rows, velocities):
        return (
            "This is the velocity Verlet method: second order, two slopes a step. Take four slopes, of positions and "
            "velocities alike, with weights 1, 2, 2, 1 over 6."
        )
    return (
        explain_velocity_ahead(rows, velocities)
        or explain_own_velocity(rows)
        or explain_last_velocity(result, Term("v", reading.calls + 1))
    )


def explain_velocity_ahead(rows: Combinations, velocities: Matrix) -> str | None:
    """Returns the sentence of positions whose slope is v + c h a, in the place of v, with the same c in every row that
    is not the classical one."""
    if not is_same(velocities, CLASSICAL):
        return None
    shares = {row: find_share_ahead(moves or {}, row) for row, moves in enumerate(rows[1:], 2)}
    wrong = {row: share for row, share in shares.items() if share != 0}
    known = [share for share in wrong.values() if share is not None]
    if len(known) < len(wrong) or not known or np.ptp(known) > COEFFICIENT_ATOL:
        return None
    if [*wrong] == [2] and abs(known[0] - 1 / 2) <= COEFFICIENT_ATOL:  # its own new velocity
        return None
    term = f"{'-' if known[0] < 0 else '+'} {write_row((abs(known[0]),)).removesuffix(' k1')} data.qacc"
    stages = [str(row) for row in wrong if row <= STAGES]
    places = [f"stage{'s' if len(stages) > 1 else ''} {join_words(stages)}"] if stages else []
    places += ["the weighted sum"] if STAGES + 1 in wrong else []
    return (
        f"In {' and in '.join(places)} your positions move as if their slope were data.qvel {term}: take data.qvel "
        "alone, as it stands when mj_forward is called."
    )


def find_share_ahead(moves: Combination, row: int) -> float | None:
    """Returns the c of a row of positions that move by v + c h a: beside the classical sum of velocities, c times what
    the row's own velocity has gained. 0 for the classical row; None for others."""
    classical = dict(enumerate(CLASSICAL[row - 1], 1))
    share = moves.get(Term("v", row), 0.0)
    right = {stage: classical.get(stage, 0.0) - (share if stage == 1 else 0.0) for stage in range(1, row)}
    due = {Term("v", stage): value for stage, value in {**right, row: share}.items() if abs(value) > COEFFICIENT_ATOL}
    return share if is_close(moves, due) else None


def explain_own_velocity(rows: Combinations) -> str | None:
    """Returns the sentence of stages whose positions move by the velocity of the same stage."""
    own = [index for index, row in enumerate(rows[:-1], 1) if row and set(row) == {Term("v", index)}]
    mean = next((index for index, row in enumerate(rows[:-1], 1) if row and is_own_mean(row, index)), None)
    if mean is not None and not own:
        return (
            f"In your stage {mean}, the position moves by the mean of its old and its own new velocity, the formula of "
            "constant acceleration (h v + h h a/2): move it by the velocity of the stage before alone."
        )
    if not own:
        return None
    if own[0] == 1:
        return (
            "Your positions have moved already when mj_forward is first called: positions and velocities move in turn, "
            "as in a leapfrog. Call it first at the start of the step, for k1, and move both together, from the start, "
            "to each stage."
        )
    whose, their = ("stages move", "their") if len(own) > 1 else (f"stage {own[0]} moves", "its")
    return f"Your {whose} the position with {their} own new velocity; use the velocity of the stage before."


def is_own_mean(row: Combination, stage: int) -> bool:
    """Whether a stage's position moves by equal shares of the first velocity and of its own."""
    first, own = row.get(Term("v", 1)), row.get(Term("v", stage))
    return len(row) == 2 and first is not None and own is not None and abs(first - own) <= COEFFICIENT_ATOL


def explain_last_velocity(result: Combination, after: Term) -> str | None:
    """Returns the sentence of positions that move by the velocity `after` the step."""
    if is_close(result, {after: 1}):
        return "The position advances with the new velocity alone; use the weighted mean of the four stage velocities."
    classical = {Term("v", stage): weight for stage, weight in enumerate(CLASSICAL[-1][:-1], 1)}
    if is_close(result, {**classical, after: CLASSICAL[-1][-1]}):
        return (
            "In the weighted sum of the positions the velocity after your step stands in the place of that of stage 4: "
            "copy data.qvel in stage 4 too, before you write the new one."
        )
    if is_mean(result, after):
        return (
            "Positions move by the mean of old and new velocity: use the weighted mean of the four stage velocities, "
            "(v1 + 2 v2 + 2 v3 + v4)/6."
        )
    return None


def explain_single_call(result: Combination, velocities: Matrix) -> str | None:
    """Returns the sentence of a single acceleration, by which the velocity moves."""
    if not is_same(velocities, [(), (1,)]):
        return None
    tail = "one acceleration a step, not four. Add the stages k2, k3 and k4."
    if is_close(result, {Term("v", 2): 1}):
        return f"This is semi-implicit Euler: {tail}"
    if is_mean(result, Term("v", 2)):
        return f"Positions move by the mean of old and new velocity, velocities by Euler's method: {tail}"
    return None


def is_mean(result: Combination, after: Term) -> bool:
    """Whether positions move by the mean of old and new velocity."""
    return any(is_close(result, {Term("v", start): 1 / 2, after: 1 / 2}) for start in (0, 1))


def is_verlet(positions: Combinations, velocities: Matrix) -> bool:
    """Whether this is the velocity Verlet method: its second stage lies at h v + h h a/2, which is also reached by half
    a kick and a drift."""
    kicked = {Term("v", 2): 1.0}
    if all(row is not None and is_close(row, kicked) for row in (positions[1], positions[-1])):
        return is_same(velocities, [(), (1 / 2,), (1 / 2, 1 / 2)])
    mean = {Term("v", 1): 1 / 2, Term("v", 2): 1 / 2}
    moved = all(row is not None and is_close(row, mean) for row in (positions[1], positions[-1]))
    return moved and is_same(velocities, [(), (1,), (1 / 2, 1 / 2)])


def explain_mixed_slopes(reading: Reading) -> str | None:
    """Returns the sentence of positions that move by velocities and accelerations."""
    rows = [row for row in reading.positions if row and {term.slope for term in row} == {"v", "a"}]
    if not rows:
        return None
    result = reading.positions[-1]
    if result and any(is_close(result, {Term("v", stage): 1, Term("a", 1, 2): 1 / 2}) for stage in (0, 1)):
        return (
            "The position advances by h v + h h a/2, the formula of constant acceleration; use the weighted mean of "
            "the four stage velocities."
        )
    return (
        "Your positions move by velocities at which mj_forward was never asked: the slope of a position is the "
        "velocity in data.qvel when that stage is evaluated."
    )


def is_close(one: Combination, other: Mapping[Term, float]) -> bool:
    """Whether two combinations are the same."""
    return one.keys() == other.keys() and all(abs(one[term] - value) <= 1e-8 for term, value in other.items())


def follows_classical(reading: Reading) -> bool:
    """Whether positions and velocities follow the classical method, in the coordinates that move at all."""
    tableaus = to_matrix(reading.velocities, "a"), to_matrix(reading.positions, "v")
    return all(rows is not None and is_same(rows, CLASSICAL) for rows in tableaus)


RULES: tuple[Rule, ...] = (
    explain_borrowed_slopes, explain_powers_of_h, explain_early_calls, explain_whole_method, explain_several_views,
    explain_separate_rules,
)  # fmt: skip
"""Mistakes in the slopes of a step and their coefficients."""
