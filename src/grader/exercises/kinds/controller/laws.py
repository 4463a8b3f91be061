"""Fits the law behind a controller's answers: a linear function of what it observed, perhaps of the step before, of
differences, or of the sum of errors. A law that fits to rounding is taken for the student's own."""

from dataclasses import dataclass
from math import isclose

import mujoco
import numpy as np

from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import Floats, Mask, Record

EXACT = 1 - 1e-10
"""The share of the variance of the controls that a law explains which is written down: all but rounding."""

ROUGH = 0.99
"""The share that is enough to tell the sign of a gain."""

CANCELS = 30.0
"""Parts of a law that are larger than the controls by this factor cancel each other: what was observed moves together,
and leaves the gains open."""

CARRIED = (-1, 1, 2)
"""How often a law adds what holds the model against gravity. Another factor is that of a law about something else, such
as the acceleration."""

ROUNDS = 1e-3
"""How far such a factor may be off, relatively: by rounding, and by forces of the motion."""

ROWS_MIN = 12
"""Fewer controls than this tell no law."""


@dataclass(frozen=True)
class FittedLaw:
    """Controls = observed now (or a step before) times `gains`, plus `difference` times their change, plus `integral`
    times the sum of errors over time [1/s], plus `gravity` times what holds the model against gravity, plus a
    `constant`."""

    gains: Floats
    difference: Floats
    integral: float
    stale: bool
    constant: float
    gravity: float = 0.0

    @property
    def differentiates(self) -> bool:
        """Whether the change of what was observed plays a part."""
        return bool(np.any(np.nan_to_num(self.difference)))


def fit_law(
    record: Record, *, track: int, has_target: bool, fits: float = EXACT, load: Floats | None = None
) -> FittedLaw | None:
    """Returns the simplest law that explains a share `fits` of the variance of the first control; None if none does.
    `track` is the place of the tracked sensor in what was observed, `load` the control that holds the model against
    gravity at each moment. Only controls between their extremes are looked at: a script may clip its own."""
    if len(record.time_s) < ROWS_MIN:
        return None
    seen, asked = record.observed, record.asked[:, 0]
    before = np.vstack((seen[:1], seen[:-1]))
    error = (seen[:, -1] if has_target else 0.0) - seen[:, track]
    sums = (np.cumsum(error) * (record.time_s[1] - record.time_s[0]))[:, None]
    free = find_free(asked)
    width = seen.shape[1]
    none = np.empty((len(seen), 0))
    loads = none if load is None else load[:, None]
    for base, change, integral, gravity in (
        (seen, none, none, none),
        (before, none, none, none),
        (seen, none, none, loads),
        (seen, none, sums, none),
        (seen, none, sums, loads),
        (seen, seen - before, none, none),
        (seen, seen - before, sums, none),
    ):
        solved = solve(np.hstack((base, change, gravity, integral)), asked, free, fits)
        if solved is not None:
            gains, constant = solved
            changes = np.nan_to_num(gains[width : width + change.shape[1]])
            carried = float(np.nan_to_num(gains[width + change.shape[1]])) if gravity.size else 0.0
            if carried and not any(isclose(carried, known, rel_tol=ROUNDS) for known in CARRIED):
                continue
            summed = float(np.nan_to_num(gains[-1])) if integral.size else 0.0
            return FittedLaw(gains[:width], changes, summed, base is before, constant, carried)
    return None


def find_free(asked: Floats) -> Mask:
    """Returns where the control differs from both its extremes, at which a script may have clipped it; the first calls,
    which have no earlier one, are left out."""
    edge = 1e-9 * float(np.ptp(asked))
    free = np.asarray((asked > asked.min() + edge) & (asked < asked.max() - edge))
    free[:3] = False
    return free


def solve(columns: Floats, asked: Floats, free: Mask, fits: float) -> tuple[Floats, float] | None:
    """Returns the gains of columns that do not stay constant (nan for the others), and the constant beside them, if
    they explain the controls and do not merely cancel each other."""
    rows, wanted = columns[free], asked[free]
    if len(rows) < max(ROWS_MIN, 2 * columns.shape[1]) or np.var(wanted) == 0:
        return None
    scale = rows.std(axis=0)
    moving = scale > 1e-12
    matrix = np.column_stack((rows[:, moving] / scale[moving], np.ones(len(rows))))
    solution, _, rank, _ = np.linalg.lstsq(matrix, wanted, rcond=1e-12)
    left = wanted - matrix @ solution
    if rank < matrix.shape[1] or 1 - np.var(left) / np.var(wanted) < fits:
        return None
    if np.abs(solution[:-1]).max(initial=0.0) > CANCELS * wanted.std():
        return None
    gains = np.full(columns.shape[1], np.nan)
    gains[moving] = solution[:-1] / scale[moving]
    return gains, float(solution[-1])


def measure_load(problem: Problem, record: Record) -> Floats | None:
    """Returns the first control that holds the model, as the learner has it, against gravity in each period; None where
    that control acts on no joint of one number."""
    model = problem.model
    joint, gear = model.actuator_trnid[0, 0], model.actuator_gear[0, 0]
    if model.actuator_trntype[0] != int(mujoco.mjtTrn.mjTRN_JOINT) or not gear:
        return None
    if model.jnt_type[joint] < int(mujoco.mjtJoint.mjJNT_SLIDE):  # a free or a ball joint
        return None
    data, loads, forces = mujoco.MjData(model), np.empty(len(record.qpos)), np.empty(model.nv)
    for index, qpos in enumerate(record.qpos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_rne(model, data, 0, forces)
        loads[index] = forces[model.jnt_dofadr[joint]] / gear
    return loads
