"""Tells which velocity moves which number of data.qpos: the addresses and axes of free, ball and other joints. Each
rule predicts numbers of data.qpos from the velocities of the calls, by the tableau of the velocities. For a body at
rest or upright a wrong rule may predict the same numbers: it is named only where the right one fails."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product as product_of

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.judging.quaternions import OFFSETS, QuaternionAddress, find_quaternions, list_joints
from grader.exercises.kinds.rk4.rotations import (
    EXACT,
    add_rates,
    conjugate,
    predicts_all,
    rotate,
    sample_all_rotations,
    sample_rotations,
    turn_in_body,
)
from grader.exercises.kinds.rk4.step_trace import Step
from grader.exercises.kinds.rk4.tableau import Matrix, pad_row
from grader.exercises.rules import find_sentence

BALL, FREE = int(mujoco.mjtJoint.mjJNT_BALL), int(mujoco.mjtJoint.mjJNT_FREE)

LENGTH_ATOL = 1e-3
"""How far a quaternion's length may be from 1; one that is not normalised after a step stays far below."""


@dataclass(frozen=True, eq=False)
class Moves:
    """The steps of a model with the tableau of their velocities. `hidden`: no joint of the model may be named."""

    model: mujoco.MjModel
    steps: Sequence[Step]
    rows: Matrix
    hidden: bool


def explain_misplaced(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix, *, hidden: bool) -> str | None:
    """Returns the sentence of numbers in data.qpos that move by other velocities than theirs; None if none do."""
    return find_sentence(RULES, Moves(model, steps, rows, hidden))


def explain_added_velocities(moves: Moves) -> str | None:
    """Returns the sentence of positions to which the velocities are added number by number, as far as they reach."""
    model, steps, rows = moves.model, moves.steps, moves.rows
    has_free_joint = FREE in model.jnt_type  # else another joint type may be unknown
    rotations = sample_all_rotations(model, steps)
    if not has_free_joint or predicts_all(turn_in_body, rotations, rows):
        return None
    normalised = predicts_all(add_rates, rotations, rows)  # also where the quaternion is normalised afterwards
    if not normalised and not all(moves_by(steps, dof, dof, rows) for dof in range(int(model.nv))):
        return None
    return (
        "Your velocities are added to data.qpos number by number, also where it holds a quaternion, which has four "
        "numbers for three velocities and turns: move the positions with mj_integratePos."
    )


def explain_quaternion_first(moves: Moves) -> str | None:
    """Returns the sentence of a free joint whose first four numbers turn like a quaternion."""
    steps, rows = moves.steps, moves.rows
    free = list_free_joints(moves.model)
    if all(moves_by_own_velocity(steps, at, dof, rows) for at, dof in free):
        return None
    for shift in (0, 3):
        rotations = [
            samples for at, dof in free for samples in sample_rotations(steps, QuaternionAddress(at, dof + shift))
        ]
        if predicts_all(turn_in_body, rotations, rows):
            return (
                "The first four numbers of a free joint in data.qpos turn like a quaternion, but the first three are "
                "its place, and the quaternion follows. In model.jnt_type 0 is a free joint, and 1 a ball joint."
            )
    return None


def explain_still_quaternion(moves: Moves) -> str | None:
    """Returns the sentence of a quaternion that never changes although its angular velocity is not 0."""
    for address in find_quaternions(moves.model):
        rotations = sample_rotations(moves.steps, address)
        if all(np.any(rotation.rates) and not np.any(rotation.quats - rotation.quats[0]) for rotation in rotations):
            return (
                "A quaternion in data.qpos never changes, although its angular velocity is not 0: turn it at every "
                "stage and at the end, with mj_integratePos or by a product of quaternions."
            )
    return None


def explain_still_balls(model: mujoco.MjModel, steps: Sequence[Step]) -> str | None:
    """Returns the sentence of a model with nothing but ball joints, none of which ever turns."""
    still = all(np.array_equal(row, step.qpos[0]) for step in steps for row in step.qpos[1:])
    if not still or any(kind != BALL for kind in model.jnt_type):
        return None
    return (
        "The quaternion of a ball joint never changes, although its velocity does: it stands alone in data.qpos, at "
        "model.jnt_qposadr[joint], without a place before it. Turn it as you turn that of a free joint."
    )


def explain_quaternion_length(model: mujoco.MjModel, steps: Sequence[Step]) -> str | None:
    """Returns the sentence of quaternions that turn rightly and are not of length 1."""
    lengths = (np.linalg.norm(samples.quats, axis=1) for samples in sample_all_rotations(model, steps))
    if all(np.all(np.abs(length - 1) <= LENGTH_ATOL) for length in lengths):
        return None
    return (
        "Your quaternions turn as they should, but their length is not 1: divide the four numbers of each quaternion "
        "by the norm of these four alone."
    )


def explain_linear_axes(moves: Moves) -> str | None:
    """Returns the sentence of a free joint whose linear velocity is turned by the orientation though it must not be."""
    steps, rows = moves.steps, moves.rows
    for at, dof in list_free_joints(moves.model):
        if moves_by_own_velocity(steps, at, dof, rows):
            continue
        for inward, once in product_of((False, True), (False, True)):
            if all(moves_by_turned_velocity(step, at, dof, rows, inward=inward, once=once) for step in steps):
                return (
                    "The linear velocity of a free joint is in world axes already: your step turns it by the "
                    "orientation before it moves the position. Add h times data.qvel[0:3] as it is."
                )
    return None


def explain_swapped_halves(moves: Moves) -> str | None:
    """Returns the sentence of a free joint whose place moves by its angular velocity."""
    steps, rows = moves.steps, moves.rows
    free = list_free_joints(moves.model)
    if all(moves_by_own_velocity(steps, at, dof, rows) for at, dof in free) or not all(
        moves_by(steps, at + i, dof + 3 + i, rows) for at, dof in free for i in range(3)
    ):
        return None
    return (
        "The place of a free joint moves by its angular velocity: of its six numbers in data.qvel the first three are "
        "the linear velocity, the last three the angular one. Exchange them."
    )


def moves_by_turned_velocity(step: Step, at: int, dof: int, rows: Matrix, *, inward: bool, once: bool) -> bool:
    """Whether the place of a free joint moves by its velocity turned by an orientation: that of each call, or `once`
    by that at the start of the step."""
    quats = [quat / max(np.linalg.norm(quat), 1e-300) for quat in step.qpos[:, at + 3 : at + 7]]
    quats = [quats[0]] * len(quats) if once else quats
    turned = [
        rotate(conjugate(quat) if inward else quat, velocity)
        for quat, velocity in zip(quats, step.qvel[:, dof : dof + 3], strict=True)
    ][1 : step.calls + 1]
    moves = np.array([pad_row(row, step.calls) @ np.array(turned) for row in rows]) * step.timestep_s
    seen = step.qpos[1:, at : at + 3] - step.qpos[0, at : at + 3]
    return bool(np.max(np.abs(moves - seen)) <= EXACT * (1 + np.max(np.abs(step.qpos))))


def explain_wrong_address(moves: Moves) -> str | None:
    """Returns the sentence of a hinge or slide that moves by the velocity of another dof."""
    model, steps, rows = moves.model, moves.steps, moves.rows
    for joint, (kind, at, dof) in enumerate(list_joints(model), 1):
        if kind in OFFSETS or moves_by(steps, at, dof, rows):
            continue
        other = next((i for i in range(int(model.nv)) if i != dof and moves_by(steps, at, i, rows)), None)
        if other is None:
            continue
        name = "a joint" if moves.hidden else f"joint {joint}"
        seen = (
            f"qvel of {name} is read at jnt_qposadr"
            if other == at
            else f"{name} is moved by the velocity of another joint"
        )
        return f"{seen}: its place in data.qvel is jnt_dofadr, which differs from jnt_qposadr after a quaternion."
    return None


def moves_by_own_velocity(steps: Sequence[Step], at: int, dof: int, rows: Matrix) -> bool:
    """Whether the place of a free joint moves by its own linear velocity."""
    return all(moves_by(steps, at + i, dof + i, rows) for i in range(3))


def list_free_joints(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Returns the addresses of every free joint in qpos and in qvel."""
    return [(at, dof) for kind, at, dof in list_joints(model) if kind == FREE]


def moves_by(steps: Sequence[Step], at: int, dof: int, rows: Matrix) -> bool:
    """Whether one position moves by one velocity, by the tableau."""
    for step in steps:
        moves = step.timestep_s * np.array(
            [pad_row(row, step.calls) @ step.qvel[1 : step.calls + 1, dof] for row in rows]
        )
        if np.max(np.abs(step.qpos[1:, at] - step.qpos[0, at] - moves)) > EXACT * (1 + abs(step.qpos[0, at])):
            return False
    return True


RULES: tuple[Callable[[Moves], str | None], ...] = (
    explain_linear_axes, explain_swapped_halves, explain_added_velocities, explain_quaternion_first,
    explain_still_quaternion, explain_wrong_address,
)  # fmt: skip
"""Velocities that move other numbers of data.qpos than theirs; the first rule that applies is named."""
