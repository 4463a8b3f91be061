"""Runge-Kutta methods by name, and the order that a tableau shows."""

from collections.abc import Mapping, Sequence

import numpy as np

from grader.exercises.kinds.rk4.tableau import CLASSICAL, COEFFICIENT_ATOL, Matrix, Row, look_up, pad_row
from grader.numerics.accuracy.runge_kutta import WEIGHTS

ROOT5, ROOT2 = 5**0.5, 2**0.5

RALSTON: Matrix = (
    (),
    (0.4,),
    ((-2889 + 1428 * ROOT5) / 1024, (3785 - 1620 * ROOT5) / 1024),
    ((-3365 + 2094 * ROOT5) / 6040, (-975 - 3046 * ROOT5) / 2552, (467040 + 203968 * ROOT5) / 240845),
    (
        (263 + 24 * ROOT5) / 1812,
        (125 - 1000 * ROOT5) / 3828,
        1024 * (3346 + 1623 * ROOT5) / 5924787,
        (30 - 4 * ROOT5) / 123,
    ),
)
"""Source: Ralston 1962, the fourth-order tableau of least truncation error."""

GILL: Matrix = (
    (),
    (1 / 2,),
    ((ROOT2 - 1) / 2, (2 - ROOT2) / 2),
    (0, -ROOT2 / 2, (2 + ROOT2) / 2),
    (1 / 6, (2 - ROOT2) / 6, (2 + ROOT2) / 6, 1 / 6),
)
"""Source: Gill 1951."""

NAMED: Mapping[str, Matrix] = {
    "explicit Euler: one slope a step, taken at its start": ((), (1,)),
    "the midpoint method: second order, two slopes a step": ((), (1 / 2,), (0, 1)),
    "Heun's method: second order, two slopes a step": ((), (1,), (1 / 2, 1 / 2)),
    "Ralston's method of second order, two slopes a step": ((), (2 / 3,), (1 / 4, 3 / 4)),
    "the implicit midpoint rule, its middle found by repetition: second order, one slope counts": (
        *((), (1 / 2,), (0, 1 / 2), (0, 0, 1 / 2)),
        (0, 0, 0, 1),
    ),
    "Kutta's third-order method": ((), (1 / 2,), (-1, 2), (1 / 6, 2 / 3, 1 / 6)),
    "Heun's third-order method": ((), (1 / 3,), (0, 2 / 3), (1 / 4, 0, 3 / 4)),
    "Ralston's third-order method": ((), (1 / 2,), (0, 3 / 4), (2 / 9, 1 / 3, 4 / 9)),
    "the strong-stability-preserving third-order method": ((), (1,), (1 / 4, 1 / 4), (1 / 6, 1 / 6, 2 / 3)),
    "Kutta's 3/8 rule": ((), (1 / 3,), (-1 / 3, 1), (1, -1, 1), (1 / 8, 3 / 8, 3 / 8, 1 / 8)),
    "Ralston's method": RALSTON,
    "Gill's method": GILL,
}
"""Methods other than the classical one: stages, then weights."""


def find_name(rows: Matrix) -> str | None:
    """Returns the name of a tableau; None if it has none here."""
    return look_up(rows, NAMED)


def compute_order(rows: Matrix) -> int:
    """Returns the order of a method, at most 5: how many groups of Butcher's order conditions its tableau meets.
    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.2."""
    *stages, weights = rows
    a = np.stack([pad_row(row, len(stages)) for row in stages])
    b, c = pad_row(weights, len(stages)), a.sum(axis=1)
    ac, ac2, aac = a @ c, a @ c**2, a @ (a @ c)
    conditions = (
        [(b.sum(), 1)],
        [(b @ c, 2)],
        [(b @ c**2, 3), (b @ ac, 6)],
        [(b @ c**3, 4), (b @ (c * ac), 8), (b @ ac2, 12), (b @ aac, 24)],
        [
            *((b @ c**4, 5), (b @ (c**2 * ac), 10), (b @ ac**2, 20), (b @ (c * ac2), 15), (b @ (c * aac), 30)),
            *((b @ (a @ c**3), 20), (b @ (a @ (c * ac)), 40), (b @ (a @ ac2), 60), (b @ (a @ aac), 120)),
        ],
    )
    for order, group in enumerate(conditions):
        if any(abs(value - 1 / divisor) > COEFFICIENT_ATOL for value, divisor in group):
            return order
    return len(conditions)


def chain_stages(rows: Sequence[Row]) -> Matrix:
    """Returns the tableau of stages that each start from the stage before, not from the start of the step."""
    size = len(rows) - 1
    return [*np.cumsum([pad_row(row, size) for row in rows[:-1]], axis=0).tolist(), list(rows[-1])]


def chain_stages_and_result(rows: Sequence[Row]) -> Matrix:
    """Returns the tableau of `chain_stages` whose result starts from the last stage too."""
    stages = chain_stages(rows)[:-1]
    return [*stages, (pad_row(stages[-1], len(stages)) + pad_row(rows[-1], len(stages))).tolist()]


def move_on_from(stage: int) -> Matrix:
    """Returns the classical tableau, all rows after `stage` of which start from that stage."""
    size = len(CLASSICAL) - 1
    shift = pad_row(CLASSICAL[stage - 1], size)
    moved = [(pad_row(row, size) + shift).tolist() for row in CLASSICAL[stage:]]
    return [*CLASSICAL[:stage], *moved]


def chain_views(rows: Sequence[Row]) -> Matrix:
    """Returns the tableau of `chain_stages` whose result starts from the last stage too, and sums the last slope in
    place of each."""
    stages = chain_stages(rows)[:-1]
    last = np.zeros(len(stages))
    last[-1] = sum(rows[-1])
    return [*stages, (pad_row(stages[-1], len(stages)) + last).tolist()]


def repeat_classical(times: int, share: float) -> Matrix:
    """Returns the tableau of several classical steps one after the other, each a `share` of h."""
    size, done = 4 * times, np.zeros(4 * times)
    rows = []
    for step in range(times):
        for stage in CLASSICAL[:-1]:
            row = done.copy()
            row[4 * step : 4 * step + len(stage)] = share * np.array(stage)
            rows.append(row.tolist())
        done[4 * step : 4 * step + 4] = share * np.array(WEIGHTS)
    assert len(rows) == size
    return [*rows, done.tolist()]
