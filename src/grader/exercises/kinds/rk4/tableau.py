"""Reads a Runge-Kutta step off its trace: which slopes, with which coefficients, make up each stage and the result.

Call i of mj_forward finds a state that lies some way from the start of the step, and the step ends at another:

    q_i - q_0 = h sum_j a_ij v_j      v_i - v_0 = h sum_j a_ij qacc_j      act_i - act_0 = h sum_j a_ij act_dot_j
    t_i - t_0 = c_i h

with v_j, qacc_j and act_dot_j those of call j. The last row holds the weights b. Each of the four is solved on its own
(combinations.py), over all steps of the trace at once, by the simplest terms that give it to round-off: the slopes of
earlier calls times h; then others, such as the new velocity, the leftovers of the step before, or another power of h.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.combinations import (
    RESIDUAL,
    ROUND_OFF,
    Combination,
    Rows,
    System,
    Term,
    format_coefficient,
)
from grader.exercises.kinds.rk4.step_trace import Step, compute_moves
from grader.numerics.accuracy.runge_kutta import WEIGHTS, find_rotation_slices

Row = Sequence[float]
Matrix = Sequence[Row]

CLASSICAL: Matrix = ((), (1 / 2,), (0, 1 / 2), (0, 0, 1), WEIGHTS)
"""The rows of Kutta's classical method: four stages, then the weights."""

OTHER_WEIGHTS: Sequence[Matrix] = tuple(
    [weights]
    for weights in (
        *((1.0,), (0.0, 0.0, 0.0, 1.0), (0.0, 1.0), (0.0, 0.0, 1.0), (1 / 2, 0.0, 0.0, 1 / 2)),
        *((2 / 3, 5 / 6, 4 / 3, 1 / 6), (1 / 2, 1 / 2, 1.0, 1.0)),
        *((1 / 4,) * 4, (1 / 6,) * 4, (1.0,) * 4, (1.0, 2.0, 2.0, 1.0), (1 / 8, 3 / 8, 3 / 8, 1 / 8)),
    )
)
"""Weights that activations are tried with: they change too slowly for two hidden steps to show them."""

COEFFICIENT_ATOL = 1e-8
"""Coefficients that differ by less are the same."""

STALE, SMOOTH = "stale", "smooth"
"""Slopes beside those of the tableau: qacc as it stood before the step, and qacc_smooth of a call."""


@dataclass(frozen=True, eq=False)
class Reading:
    """What makes up each stage and, in the last row, the result; None where nothing does. `slope` names in terms: "v"
    (stage 0: at the start of the step; n + 1: after it), "a", "r", "t". `idle` are the dofs whose velocity never
    changes, `still` those whose position never does, but for rotations; the rows leave them out. Rotations are left out
    of the positions where there are others: rotations.py reads them."""

    model: mujoco.MjModel
    calls: int
    steps: Sequence[Step]
    positions: Sequence[Combination | None]
    velocities: Sequence[Combination | None]
    activations: Sequence[Combination | None]
    times: Sequence[Combination | None]
    idle: Sequence[int]
    still: Sequence[int]

    @property
    def has_four_calls(self) -> bool:
        """Whether a step calls mj_forward as often as the classical one, calls that it does not use included."""
        return self.steps[0].calls == len(CLASSICAL) - 1


Rule = Callable[[Reading], str | None]
"""Returns the sentence of a mistake that a reading shows; None if it does not."""


@dataclass(frozen=True, eq=False)
class StatePart:
    """One of the four parts of the state: its change from the start of a step to `row`, and the slopes beside it."""

    change: Callable[[Step, int], Rows]
    terms: Callable[[Step], Mapping[Term, Rows]]
    size: Callable[[Step], float]

    def build_systems(self, steps: Sequence[Step], chosen: Sequence[int]) -> list[System]:
        """Returns the equations of every row, over the chosen coordinates of all steps."""
        slopes = [self.terms(step) for step in steps]
        terms = {term: np.concatenate([slope[term][chosen] for slope in slopes]) for term in slopes[0]}
        largest = [np.max(np.abs(next(iter(slope.values()), np.zeros(1))), initial=0.0) for slope in slopes]
        systems = []
        for row in range(1, steps[0].calls + 2):
            changes = [self.change(step, row)[chosen] for step in steps]
            allowed = [
                np.full(len(change), RESIDUAL * max(most, np.max(np.abs(change))) + ROUND_OFF * (1 + self.size(step)))
                for step, change, most in zip(steps, changes, largest, strict=True)
            ]
            systems.append(System(np.concatenate(changes), np.concatenate(allowed), terms))
        return systems


def scale_by_powers(slope: str, stage: int, step: Step, values: Rows) -> Iterator[tuple[Term, Rows]]:
    """Yields a slope times h, once, twice, and not at all."""
    for power in (1, 2, 0):
        yield Term(slope, stage, power), values * step.timestep_s**power


def build_position_part(change: Callable[[Step, int], Rows]) -> StatePart:
    """Positions: velocities of all calls, the old and the new one, and accelerations times h squared."""

    def list_terms(step: Step) -> dict[Term, Rows]:
        stages = range(1, step.calls + 2)
        terms = dict(pair for stage in (*stages, 0) for pair in scale_by_powers("v", stage, step, step.qvel[stage]))
        for stage, power in product(range(1, step.calls + 1), (1, 2)):
            terms[Term("a", stage, power)] = step.timestep_s**power * step.qacc[stage]
        return terms

    return StatePart(change, list_terms, lambda step: float(np.max(np.abs(step.qpos))))


def list_velocity_terms(step: Step) -> dict[Term, Rows]:
    """Accelerations: those of all calls, what was left over before, and those without constraint forces."""
    stages = range(1, step.calls + 1)
    terms = dict(pair for stage in stages for pair in scale_by_powers("a", stage, step, step.qacc[stage]))
    terms |= dict(scale_by_powers(STALE, 0, step, step.qacc[0]))
    terms |= {Term("v", stage): step.timestep_s * step.qvel[stage] for stage in stages}
    return terms | {Term(SMOOTH, stage): step.timestep_s * step.smooth[stage - 1] for stage in stages}


def list_rate_terms(step: Step) -> dict[Term, Rows]:
    """Rates of the activations."""
    return dict(
        pair for stage in range(1, step.calls + 1) for pair in scale_by_powers("r", stage, step, step.rate[stage - 1])
    )


def list_time_terms(step: Step) -> dict[Term, Rows]:
    """Returns the timestep, and the time at the start of the step."""
    return {Term("t", 0): np.array([step.timestep_s]), Term("t", 0, 0): step.time[:1], Term("t", 1, 0): np.ones(1)}


VELOCITIES = StatePart(
    lambda step, row: step.qvel[row] - step.qvel[0], list_velocity_terms, lambda s: float(np.max(np.abs(s.qvel)))
)
ACTIVATIONS = StatePart(
    lambda step, row: step.act[row] - step.act[0], list_rate_terms, lambda s: float(np.max(np.abs(s.act)))
)
TIMES = StatePart(
    lambda step, row: step.time[row : row + 1] - step.time[0], list_time_terms, lambda s: float(np.max(np.abs(s.time)))
)


def build_positions(model: mujoco.MjModel) -> StatePart:
    """Positions of a model, with rotations as vectors in the body's axes."""
    return build_position_part(lambda step, row: compute_moves(model, step.qpos[0], step.qpos[row : row + 1])[0])


def read_tableau(model: mujoco.MjModel, steps: Sequence[Step], known: Matrix = CLASSICAL) -> Reading | None:
    """Returns the reading of steps; None without steps. `known`: rows that are tried first, stages and weights."""
    if not steps:
        return None
    calls = Counter(step.calls for step in steps).most_common(1)[0][0]
    alike = [step for step in steps if step.calls == calls]
    positions = build_positions(model)
    dofs = range(int(model.nv))
    idle = [dof for dof in dofs if never_changes(VELOCITIES, alike, dof)]
    turning = [dof for turn in find_rotation_slices(model) for dof in range(turn.start, turn.stop)]
    straight = exclude(dofs, turning)
    still = [dof for dof in straight if dof not in turning and never_changes(positions, alike, dof)]
    velocities = read_rows(VELOCITIES.build_systems(alike, exclude(dofs, idle)), "a", (known,))
    from_velocities = [
        {Term("v", term.stage, term.power): value for term, value in row.items()} if row else {} for row in velocities
    ]
    acts = range(alike[0].act.shape[1])
    reading = Reading(
        model, calls, alike,
        positions=read_rows(positions.build_systems(alike, exclude(straight, still)), "v", (known,), from_velocities),
        velocities=velocities,
        activations=read_rows(ACTIVATIONS.build_systems(alike, acts), "r", (known, *OTHER_WEIGHTS)) if acts else (),
        times=read_rows(TIMES.build_systems(alike, range(1)), "t", ()), idle=idle, still=still
    )  # fmt: skip
    return drop_unused_calls(reading)


def drop_unused_calls(reading: Reading) -> Reading:
    """Returns a reading without the calls whose slopes are used nowhere, such as a glance at another state. Its steps
    keep them, as some rules look at them, but for a last one at the state that the step leaves."""
    parts = (reading.positions, reading.velocities, reading.activations)
    used = {term.stage for part in parts for row in part if row for term in row if term.slope in "avr"}
    used_stages = [stage for stage in range(1, reading.calls + 1) if stage in used]
    if len(used_stages) in (0, reading.calls) or reading.calls <= len(CLASSICAL) - 1:
        return reading
    ends_with_a_call = reading.calls not in used and all(step.ends_with_a_call for step in reading.steps)
    new_stages = {old: index for index, old in enumerate([*used_stages, reading.calls + 1], 1)} | {0: 0}

    def renumber(part: Sequence[Combination | None]) -> list[Combination | None]:
        rows = [part[stage - 1] for stage in (*used_stages, reading.calls + 1)] if part else []
        return [
            {
                Term(term.slope, new_stages[term.stage] if term.slope in "avr" else term.stage, term.power): value
                for term, value in row.items()
            }
            if row is not None and all(term.stage in new_stages or term.slope == "t" for term in row)
            else None
            for row in rows
        ]

    return replace(
        reading,
        calls=len(used_stages),
        steps=[step.drop_last_call() for step in reading.steps] if ends_with_a_call else reading.steps,
        positions=renumber(reading.positions),
        velocities=renumber(reading.velocities),
        activations=renumber(reading.activations),
        times=renumber(reading.times),
    )


def never_changes(part: StatePart, steps: Sequence[Step], dof: int) -> bool:
    """Whether a coordinate is in every row of every step as at its start."""
    return not any(part.change(step, row)[dof] for step in steps for row in range(1, step.calls + 2))


def exclude(every: Sequence[int], without: Sequence[int]) -> list[int]:
    """Returns the coordinates that do change; all of them if none does."""
    return [name for name in every if name not in without] or list(every)


def read_rows(
    systems: Sequence[System], slope: str, known: Sequence[Matrix], from_velocities: Sequence[Combination] = ()
) -> list[Combination | None]:
    """Returns the combinations of all stages and the result; rows of `known` and `from_velocities` are tried first."""
    combinations: list[Combination | None] = []
    for row, system in enumerate(systems, 1):
        last = row == len(systems)
        guesses: list[Combination] = [{}]
        if slope == "t":
            guesses += [{Term("t", 0): share} for share in (0.5, 1.0)]
            guesses += [{Term("t", 0): share, Term("t", 0, 0): -1.0} for share in (0.0, 0.5, 1.0)]
        for name, matrix in product((slope, SMOOTH) if slope == "a" else (slope,), known):
            if last or row < len(matrix):
                guesses.append({Term(name, i + 1): a for i, a in enumerate(matrix[-1 if last else row - 1]) if a})
        combinations.append(read_row(system, slope, row, len(systems) - 1, [*guesses, *from_velocities[row - 1 : row]]))
    return combinations


def read_row(system: System, slope: str, row: int, calls: int, guesses: Sequence[Combination]) -> Combination | None:
    """Returns the simplest combination that gives a row."""
    for guess in guesses:
        if system.explains(guess):
            return guess
    for alike in propose_terms(slope, row, calls):
        solutions = [solution for terms in alike if (solution := system.solve(terms)) is not None]
        if solutions:
            return min(solutions, key=len)
    return None


def propose_terms(slope: str, row: int, calls: int) -> Iterator[list[list[Term]]]:
    """Yields the terms that may make up a row, the simplest first; of several lists the one with the fewest terms."""
    if slope == "t":
        yield [[Term("t", 0)]]
        yield [[Term("t", 0), Term("t", 0, 0)]]
        yield [[Term("t", 1, 0)]]
        return
    earlier = range(1, min(row, calls + 1))
    yield [[Term(slope, stage) for stage in earlier]]
    if slope == "v":
        yield [[Term("v", stage) for stage in (*earlier, row, 0)]]
        yield [[Term("v", 0), *(Term("a", stage, 2) for stage in earlier)]]
        yield [[*(Term("v", stage) for stage in (*earlier, row, 0)), *(Term("a", stage, 2) for stage in earlier)]]
    if slope == "a":
        yield [[Term(STALE, 0), *(Term("a", stage) for stage in earlier)]]
        yield [[Term(SMOOTH, stage) for stage in earlier]]
    for power in (0, 2):
        yield [[Term(slope, stage, power) for stage in earlier]]
    # Steps of two lengths do not tell h and 1 from h and h * h.
    yield [[Term(slope, stage, power) for power, stage in product((1, other), earlier)] for other in (0, 2)]
    if slope == "a":
        yield [[Term(STALE, 0, power) for power in (0, 2)]]
    if slope == "a":
        yield [[Term(name, stage) for name, stage in product("av", earlier)]]
    if slope in "av":
        yield [[Term("v" if slope == "a" else "a", stage) for stage in earlier]]


def to_matrix(rows: Sequence[Combination | None], slope: str) -> list[list[float]] | None:
    """Returns rows as coefficients of the calls' slopes times h, one column a call; None if a row has other terms."""
    calls = len(rows) - 1
    matrix = []
    for row in rows:
        if row is None or any(term.slope != slope or term.power != 1 or not 1 <= term.stage <= calls for term in row):
            return None
        matrix.append([row.get(Term(slope, stage), 0.0) for stage in range(1, calls + 1)])
    return matrix


def is_same(one: Matrix, other: Matrix) -> bool:
    """Whether two tableaus have the same rows; shorter rows end in zeros."""
    return len(one) == len(other) and all(is_same_row(a, b) for a, b in zip(one, other, strict=True))


def is_same_row(one: Row, other: Row) -> bool:
    """Whether two rows have the same coefficients."""
    length = max(len(one), len(other))
    return bool(np.all(np.abs(pad_row(one, length) - pad_row(other, length)) <= COEFFICIENT_ATOL))


def look_up(rows: Matrix, table: Mapping[str, Matrix]) -> str | None:
    """Returns the text of a tableau in a table; None if it is not there."""
    return next((text for text, known in table.items() if is_same(rows, known)), None)


def look_up_row(row: Row, table: Mapping[tuple[float, ...], str]) -> str | None:
    """Returns the text of a row in a table; None if it is not there."""
    return next((text for known, text in table.items() if is_same_row(row, known)), None)


def pad_row(row: Row, length: int) -> Rows:
    """Returns a row with zeros at its end."""
    return np.array([*row, *[0.0] * (length - len(row))])


def draw_tableau(reading: Reading) -> dict[str, Any] | None:
    """Returns the tableau of the velocities, and that of the positions where it is another; None if neither is one.
    `wrong` lists the entries that differ from the classical method's: ["a", row, column], ["b", column], ["c", row]."""
    velocities, positions = to_matrix(reading.velocities, "a"), to_matrix(reading.positions, "v")
    main = velocities or positions
    if main is None or not reading.calls:
        return None
    times = [
        row.get(Term("t", 0)) if row is not None and set(row) <= {Term("t", 0)} else None for row in reading.times[:-1]
    ]
    times = [0.0 if row == {} else time for row, time in zip(reading.times[:-1], times, strict=True)]
    picture = {"of": "positions and velocities", **compare_with_classical(main, times)}
    if velocities is None or positions is None or not is_same(velocities, positions):
        picture["of"] = "velocities" if velocities else "positions"
        if velocities and positions:
            picture["positions"] = compare_with_classical(positions, times)
    return picture


def compare_with_classical(rows: Matrix, times: Sequence[float | None]) -> dict[str, Any]:
    """Returns a tableau, the classical one, and where they differ."""
    student = format_tableau(rows, times)
    classical = format_tableau([pad_row(row, 4).tolist() for row in CLASSICAL], (0, 0.5, 0.5, 1))
    wrong = [
        ["a", i, j]
        for i, row in enumerate(student["a"])
        for j, entry in enumerate(row)
        if entry != get_entry(classical["a"], i, j)
    ]
    wrong += [["b", j] for j, entry in enumerate(student["b"]) if entry != get_entry([classical["b"]], 0, j)]
    wrong += [["c", i] for i, entry in enumerate(student["c"]) if entry != get_entry([classical["c"]], 0, i)]
    return {"given": student, "asked": classical, "wrong": wrong}


def format_tableau(rows: Matrix, times: Sequence[float | None]) -> dict[str, Any]:
    """Returns a tableau as texts; each stage's row up to the slope before it, "?" for a time that is none."""
    *stages, weights = rows
    return {
        "a": [[format_coefficient(value) for value in row[:index]] for index, row in enumerate(stages)],
        "b": [format_coefficient(value) for value in weights],
        "c": ["?" if time is None else format_coefficient(time) for time in times],
    }


def get_entry(rows: Sequence[Sequence[str]], row: int, column: int) -> str:
    """Returns an entry of a tableau of texts; "0" outside it."""
    return rows[row][column] if row < len(rows) and column < len(rows[row]) else "0"
