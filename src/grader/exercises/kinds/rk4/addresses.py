"""Tells which velocity moves which number of data.qpos: the addresses and axes of free, ball and other joints.

Each rule predicts numbers of data.qpos from the velocities of the calls, by the tableau of the velocities. For a
body at rest or upright a wrong rule may predict the same numbers as the right one: a wrong rule is told only where the
right one fails.
"""

from collections.abc import Sequence
from itertools import product as product_of

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.recorded import Step
from grader.exercises.kinds.rk4.rotations import (
    EXACT,
    OFFSETS,
    Spin,
    Turning,
    alike,
    fits,
    in_the_body,
    inverse,
    like_numbers,
    rotated,
    spins_of,
    turnings,
)
from grader.exercises.kinds.rk4.tableau import Matrix, padded

LENGTH_ATOL = 1e-3
"""How far a quaternion's length may be from 1; one that is not normalised after a step stays far below."""


def misplaced(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix, *, hidden: bool) -> str | None:
    """Returns the sentence of numbers in data.qpos that move by other velocities than theirs; None if none do."""
    return (
        linear_axes(model, steps, rows)
        or swapped_halves(model, steps, rows)
        or like_angles(model, steps, rows)
        or quaternion_first(model, steps, rows)
        or still_quaternion(model, steps)
        or wrong_address(model, steps, rows, hidden=hidden)
    )


def like_angles(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of positions to which the velocities are added number by number, as far as they reach."""
    has_free_joint = int(mujoco.mjtJoint.mjJNT_FREE) in model.jnt_type  # else another joint type may be unknown
    turned = [turn for spin in spins_of(model) for turn in turnings(steps, spin)]
    if not has_free_joint or turn_rightly(turned, rows):
        return None
    normalised = fits(like_numbers, turned, rows)  # also where the quaternion is normalised afterwards
    if not normalised and not all(moves_by(steps, dof, dof, rows) for dof in range(int(model.nv))):
        return None
    return (
        "Your velocities are added to data.qpos number by number, also where it holds a quaternion, which has four "
        "numbers for three velocities and turns: move the positions with mj_integratePos."
    )


def quaternion_first(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of a free joint whose first four numbers turn like a quaternion."""
    joints = zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist(), strict=True)
    free = [(at, dof) for kind, at, dof in joints if kind == int(mujoco.mjtJoint.mjJNT_FREE)]
    if all(in_place(steps, at, dof, rows) for at, dof in free):
        return None
    for shift in (0, 3):
        turned = [turn for at, dof in free for turn in turnings(steps, Spin(at, dof + shift))]
        if turn_rightly(turned, rows):
            return (
                "The first four numbers of a free joint in data.qpos turn like a quaternion, but the first three are "
                "its place, and the quaternion follows. In model.jnt_type 0 is a free joint, and 1 a ball joint."
            )
    return None


def still_quaternion(model: mujoco.MjModel, steps: Sequence[Step]) -> str | None:
    """Returns the sentence of a quaternion that never changes although its angular velocity is not 0."""
    for spin in spins_of(model):
        turned = turnings(steps, spin)
        if all(np.any(one.rates) and not np.any(one.quats - one.quats[0]) for one in turned):
            return (
                "A quaternion in data.qpos never changes, although its angular velocity is not 0: turn it at every "
                "stage and at the end, with mj_integratePos or by a product of quaternions."
            )
    return None


def of_other_length(model: mujoco.MjModel, steps: Sequence[Step]) -> str | None:
    """Returns the sentence of quaternions that turn rightly and are not of length 1."""
    lengths = [np.linalg.norm(one.quats, axis=1) for spin in spins_of(model) for one in turnings(steps, spin)]
    if all(np.all(np.abs(one - 1) <= LENGTH_ATOL) for one in lengths):
        return None
    return (
        "Your quaternions turn as they should, but their length is not 1: divide the four numbers of each quaternion "
        "by the norm of these four alone."
    )


def linear_axes(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of a free joint whose linear velocity is turned by the orientation though it must not be."""
    for kind, at, dof in zip(
        model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist(), strict=True
    ):
        if kind != int(mujoco.mjtJoint.mjJNT_FREE) or in_place(steps, at, dof, rows):
            continue
        for inward, once in product_of((False, True), (False, True)):
            if all(drifts(step, at, dof, rows, inward=inward, once=once) for step in steps):
                return (
                    "The linear velocity of a free joint is in world axes already: your step turns it by the "
                    "orientation before it moves the position. Add h times data.qvel[0:3] as it is."
                )
    return None


def swapped_halves(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of a free joint whose place moves by its angular velocity."""
    joints = zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist(), strict=True)
    free = [(at, dof) for kind, at, dof in joints if kind == int(mujoco.mjtJoint.mjJNT_FREE)]
    if all(in_place(steps, at, dof, rows) for at, dof in free) or not all(
        moves_by(steps, at + i, dof + 3 + i, rows) for at, dof in free for i in range(3)
    ):
        return None
    return (
        "The place of a free joint moves by its angular velocity: of its six numbers in data.qvel the first three are "
        "the linear velocity, the last three the angular one. Exchange them."
    )


def drifts(step: Step, at: int, dof: int, rows: Matrix, *, inward: bool, once: bool) -> bool:
    """Whether the place of a free joint moves by its velocity turned by an orientation: that of each call, or `once`
    by that at the start of the step."""
    quats = [quat / max(np.linalg.norm(quat), 1e-300) for quat in step.qpos[:, at + 3 : at + 7]]
    quats = [quats[0]] * len(quats) if once else quats
    turned = [
        rotated(inverse(quat) if inward else quat, velocity)
        for quat, velocity in zip(quats, step.qvel[:, dof : dof + 3], strict=True)
    ][1 : step.calls + 1]
    moves = np.array([padded(row, step.calls) @ np.array(turned) for row in rows]) * step.timestep_s
    seen = step.qpos[1:, at : at + 3] - step.qpos[0, at : at + 3]
    return bool(np.max(np.abs(moves - seen)) <= EXACT * (1 + np.max(np.abs(step.qpos))))


def wrong_address(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix, *, hidden: bool) -> str | None:
    """Returns the sentence of a hinge or slide that moves by the velocity of another dof."""
    joints = zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist(), strict=True)
    for joint, (kind, at, dof) in enumerate(joints, 1):
        if kind in OFFSETS or moves_by(steps, at, dof, rows):
            continue
        other = next((one for one in range(int(model.nv)) if one != dof and moves_by(steps, at, one, rows)), None)
        if other is None:
            continue
        name = "a joint" if hidden else f"joint {joint}"
        seen = (
            f"qvel of {name} is read at jnt_qposadr"
            if other == at
            else f"{name} is moved by the velocity of another joint"
        )
        return f"{seen}: its place in data.qvel is jnt_dofadr, which differs from jnt_qposadr after a quaternion."
    return None


def in_place(steps: Sequence[Step], at: int, dof: int, rows: Matrix) -> bool:
    """Whether the place of a free joint moves by its own linear velocity."""
    return all(moves_by(steps, at + i, dof + i, rows) for i in range(3))


def turn_rightly(turned: Sequence[Turning], rows: Matrix) -> bool:
    """Whether every quaternion turns by its angular velocity, in the body's axes."""
    return all(alike(one.quats[row], in_the_body(one, rows, row)) for one in turned for row in range(1, len(rows) + 1))


def moves_by(steps: Sequence[Step], at: int, dof: int, rows: Matrix) -> bool:
    """Whether one position moves by one velocity, by the tableau."""
    for step in steps:
        moves = step.timestep_s * np.array(
            [padded(row, step.calls) @ step.qvel[1 : step.calls + 1, dof] for row in rows]
        )
        if np.max(np.abs(step.qpos[1:, at] - step.qpos[0, at] - moves)) > EXACT * (1 + abs(step.qpos[0, at])):
            return False
    return True
