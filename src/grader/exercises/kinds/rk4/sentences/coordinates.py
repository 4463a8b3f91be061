"""Says what a step does to some of its coordinates alone, and where it begins if not at its start."""

from collections.abc import Sequence

import numpy as np

from grader.exercises.kinds.rk4.combinations import Rows
from grader.exercises.kinds.rk4.sentences.tableaus import STAGES, spell_number
from grader.exercises.kinds.rk4.step_trace import Step, compute_moves
from grader.exercises.kinds.rk4.tableau import CLASSICAL, Reading

ATOL = 1e-11
"""The largest difference of a coordinate from its prediction, relative to the largest."""


def explain_reset_start(reading: Reading) -> str | None:
    """Returns the sentence of steps that begin at the model's first pose, wherever data stands."""
    steps = reading.steps
    if not reading.calls or all(np.array_equal(step.qpos[0], reading.model.qpos0) for step in steps):
        return None
    if any(np.any(step.qvel[1]) or not np.array_equal(step.qpos[1], reading.model.qpos0) for step in steps):
        return None
    return (
        "Wherever data stands, your step begins at the model's first pose at rest: the state is thrown away before it "
        "is read, as mj_resetData or a new MjData does. Begin at data.qpos and data.qvel as your step finds them."
    )


def explain_one_number(reading: Reading) -> str | None:
    """Returns the sentence of a call that finds one number in all velocities, or positions, wherever a step begins."""
    for what, field in (("position", "qpos"), ("velocity", "qvel")):
        states = [getattr(step, field) for step in reading.steps if step.calls]
        if not states or states[0].shape[1] == 1 or all(len({*state[0].tolist()}) == 1 for state in states):
            continue
        stage = next((row for row in range(1, reading.calls + 1) if all(is_one_number(s[row]) for s in states)), 0)
        if stage:
            return (
                f"In your stage {stage} every {what} is the same number: what is assigned to data.{field}[:] is one "
                f"number, or an array of one, and is spread over all of them. Print its shape: it should be model."
                f"{'nq' if field == 'qpos' else 'nv'} long."
            )
    return None


def is_one_number(values: Rows) -> bool:
    """Whether all values are the same, and not 0."""
    return bool(values[0]) and bool(np.all(values == values[0]))


def explain_some_coordinates(reading: Reading) -> str | None:
    """Returns the sentence of a step of which some coordinates are right in every row, and others are not."""
    if not reading.has_four_calls:
        return None
    for row in range(2, reading.calls + 2):
        for what, part in (("position", 0), ("velocity", 1)):
            right = np.all([compare_row(reading, step, row)[part] for step in reading.steps], axis=0)
            if np.all(right):
                continue
            return describe_coordinates(reading, row, what, np.flatnonzero(~right).tolist()) if np.any(right) else None
    return None


def compare_row(reading: Reading, step: Step, row: int) -> tuple[Rows, Rows]:
    """Returns which positions (nv,) and velocities (nv,) of a row are those of the classical method from the calls
    before it."""
    weights = np.zeros(step.calls)
    known = CLASSICAL[row - 1 if row <= STAGES else -1]
    weights[: len(known)] = known
    moves = compute_moves(reading.model, step.qpos[0], step.qpos[row : row + 1])[0]
    changes = step.qvel[row] - step.qvel[0]
    calls = slice(1, step.calls + 1)
    pairs = ((moves, weights @ step.qvel[calls]), (changes, weights @ step.qacc[calls]))
    agreements = [np.abs(seen - step.timestep_s * due) <= ATOL * (1 + np.max(np.abs(seen))) for seen, due in pairs]
    return agreements[0], agreements[1]


def describe_coordinates(reading: Reading, row: int, what: str, wrong: Sequence[int]) -> str | None:
    """Returns the sentence of the coordinates that are wrong in a row; None where they differ in another way than by
    not moving."""
    is_end = row > STAGES
    field = "data.qpos" if what == "position" else "data.qvel"
    states = [step.qpos if what == "position" else step.qvel for step in reading.steps]
    if reading.model.nq != reading.model.nv:
        return None
    stand = all(np.array_equal(state[row][wrong], state[row - 1][wrong]) for state in states)
    stay = all(np.array_equal(state[row][wrong], state[0][wrong]) for state in states)
    if not stand and not stay:
        return None
    where = "At the end of your step" if is_end else f"In your stage {row}"
    count = int(reading.model.nv)
    first = min(wrong)
    if list(wrong) == list(range(first, count)):
        which = f"only the first {'one is' if first == 1 else f'{spell_number(first)} are'} written"
    else:
        which = "some are not written" if len(wrong) > 1 else "one is not written"
    kept = "as it stood at the start of the step" if stay else "as the stage before has left it"
    plural = "positions" if what == "position" else "velocities"
    return (
        f"{where} {which} of the {plural}: the rest of {field} stands {kept}. Write all of {field}[:], whose length is "
        f"model.{'nq' if what == 'position' else 'nv'}: a model may have any number of joints."
    )


def explain_lost_length(reading: Reading) -> str | None:
    """Returns the sentence of a step whose positions end in the direction of the mean velocity, but not as far."""
    if not reading.has_four_calls:
        return None
    lengths = []
    for step in reading.steps:
        mean = step.timestep_s * (np.array(CLASSICAL[-1]) @ step.qvel[1 : STAGES + 1])
        seen = compute_moves(reading.model, step.qpos[0], step.qpos[-1:])[0]
        share = float(seen @ mean) / (float(mean @ mean) or 1.0)
        if share <= 0 or np.max(np.abs(seen - share * mean)) > ATOL * (1 + np.max(np.abs(seen))):
            return None
        lengths.append((float(np.linalg.norm(seen)) / step.timestep_s, share))
    if all(abs(share - 1) <= ATOL for _, share in lengths):
        return None
    if all(abs(length - 1) <= ATOL for length, _ in lengths):
        return (
            "At the end of your step the positions move along the weighted mean of the velocities, but by h exactly, "
            "however fast they are: the mean is divided by its own length. Leave its length as it is."
        )
    return None
