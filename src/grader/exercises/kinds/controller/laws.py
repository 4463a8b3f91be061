"""Fits the law behind a controller's answers: a linear function of what it observed, perhaps of the step before, of
differences, or of the sum of errors. A law that fits to rounding is taken for the student's own."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isclose
from typing import TypeGuard

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

ROUNDING = 1e-10
"""What a gain moves of the controls, as a share of what the largest one moves, that is rounding."""

ROWS_MIN = 12
"""Fewer controls than this tell no law."""


OTHERS_MAX = 6
"""Controls up to which each is also compared with what holds the joints of the others: their order may be wrong."""

Loads = Sequence[Floats]
"""What may hold the model against gravity, by one control: a number for each period."""


@dataclass(frozen=True)
class FittedLaw:
    """One control = observed now (or a step before) times `gains`, plus `difference` times their change, plus
    `integral` times the sum of errors over time [1/s], plus `gravity` times what holds the model against gravity, plus
    a `constant`. `size` is the standard deviation of the control: by it laws of controls in different units compare."""

    gains: Floats
    difference: Floats
    integral: float
    stale: bool
    constant: float
    gravity: float = 0.0
    size: float = 1.0

    @property
    def differentiates(self) -> bool:
        """Whether the change of what was observed plays a part."""
        return bool(np.any(np.nan_to_num(self.difference)))


Laws = tuple[FittedLaw, ...]
"""The law of each control."""


def fit_laws(
    record: Record, *, track: int, has_target: bool, fits: float = EXACT, loads: Sequence[Loads] = ()
) -> tuple[FittedLaw | None, ...]:
    """Returns the law of each control, as `fit_law` does. A control that never changes follows nothing, where another
    one does."""
    laws: list[FittedLaw | None] = []
    for index, asked in enumerate(record.asked.T):
        if len(asked) >= ROWS_MIN and np.ptp(asked) == 0 < np.ptp(record.asked, axis=0).max():
            width = record.observed.shape[1]
            laws.append(FittedLaw(np.zeros(width), np.empty(0), 0.0, stale=False, constant=float(asked[0])))
        else:
            own = loads[index] if loads else ()
            laws.append(fit_law(record, asked, track=track, has_target=has_target, fits=fits, loads=own))
    return tuple(laws)


def are_all_known(laws: tuple[FittedLaw | None, ...]) -> TypeGuard[Laws]:
    """Whether every control has a law, so that it can be said what none of them follows."""
    return all(law is not None for law in laws)


def fit_law(
    record: Record, asked: Floats, *, track: int, has_target: bool, fits: float = EXACT, loads: Loads = ()
) -> FittedLaw | None:
    """Returns the simplest law that explains a share `fits` of the variance of a control; None if none does.
    `track` is the place of the tracked sensor in what was observed, `loads` what may hold the model against gravity.
    Only controls between their extremes are looked at: a script may clip its own."""
    if len(record.time_s) < ROWS_MIN:
        return None
    seen = record.observed
    before = np.vstack((seen[:1], seen[:-1]))
    error = (seen[:, -1] if has_target else 0.0) - seen[:, track]
    sums = (np.cumsum(error) * (record.time_s[1] - record.time_s[0]))[:, None]
    free = find_free(asked)
    width = seen.shape[1]
    none = np.empty((len(seen), 0))
    columns = [load[:, None] for load in loads]
    for base, change, integral, gravity in (
        (seen, none, none, none),
        (before, none, none, none),
        *((seen, none, none, load) for load in columns),
        (seen, none, sums, none),
        *((seen, none, sums, load) for load in columns),
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
            is_stale, size = base is before, float(asked.std())
            return FittedLaw(gains[:width], changes, summed, is_stale, constant, carried, size)
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
    moves = np.abs(solution[:-1])
    solution[:-1][moves < ROUNDING * moves.max(initial=0.0)] = 0.0
    gains = np.full(columns.shape[1], np.nan)
    gains[moving] = solution[:-1] / scale[moving]
    return gains, float(solution[-1])


def measure_loads(problem: Problem, record: Record, *, of_others: bool) -> list[Loads]:
    """Returns, for each control, what may hold the model, as the learner has it, against gravity in each period: at
    rest, and with the forces of its motion, as data.qfrc_bias has them. Of a control that acts on no joint of one
    number there is nothing. With `of_others`, also what holds the joints of the other controls, if these are few."""
    model = problem.model
    data, forces = mujoco.MjData(model), np.empty((2, len(record.qpos), model.nv))
    for index, (qpos, qvel) in enumerate(zip(record.qpos, record.qvel, strict=True)):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for which, velocity in enumerate((0.0, qvel)):
            data.qvel[:] = velocity
            mujoco.mj_comVel(model, data)
            mujoco.mj_rne(model, data, 0, forces[which, index])
    still, moving = forces
    sources = (still, moving) if model.nv > 1 else (still,)
    dofs = [find_dof(model, actuator) for actuator in range(model.nu)]
    loads: list[Loads] = []
    for actuator, own in enumerate(dofs):
        others = [dof for dof in dofs if dof != own] if of_others and model.nu <= OTHERS_MAX else []
        gear = model.actuator_gear[actuator, 0]
        known = [dof for dof in (own, *others) if dof is not None and gear]
        loads.append([source[:, dof] / gear for dof in known for source in sources])
    return loads


def find_dof(model: mujoco.MjModel, actuator: int) -> int | None:
    """Returns the place in qvel of the joint that an actuator acts on; None where that is no joint of one number."""
    if model.actuator_trntype[actuator] != int(mujoco.mjtTrn.mjTRN_JOINT):
        return None
    joint = model.actuator_trnid[actuator, 0]
    if model.jnt_type[joint] < int(mujoco.mjtJoint.mjJNT_SLIDE):  # a free or a ball joint
        return None
    return int(model.jnt_dofadr[joint])
