"""Accelerations and turns of quaternions that are not MuJoCo's, each with the sentence for the student."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.judging.quaternions import find_quaternions
from grader.exercises.kinds.rk4.mutants.program import Accelerate, Vector, move_rightly
from grader.exercises.kinds.rk4.rotations import build_turn, multiply


def solve_mass_matrix(model: mujoco.MjModel, data: mujoco.MjData, force: Vector) -> Vector:
    """Returns the accelerations (nv,) of a generalised force (nv,)."""
    solution = np.zeros((1, model.nv))
    mujoco.mj_solveM(model, data, solution, np.asarray(force, dtype=np.float64).reshape(1, -1))
    return np.array(solution[0])


AGAIN = "data.qacc holds it already, so integrate it as mj_forward leaves it"

ACCELERATIONS: Sequence[tuple[str, Accelerate]] = (
    (f"Your accelerations take off damping once more: {AGAIN}.",
     lambda model, data: data.qacc - model.dof_damping * data.qvel),
    (f"Your accelerations take off damping once more: {AGAIN}.",
     lambda model, data: data.qacc - solve_mass_matrix(model, data, model.dof_damping * data.qvel)),
    (f"Your accelerations take off qfrc_bias (gravity, Coriolis) once more: {AGAIN}.",
     lambda model, data: data.qacc - solve_mass_matrix(model, data, data.qfrc_bias)),
    (f"Your accelerations add qfrc_bias (gravity, Coriolis), which cancels it: {AGAIN}.",
     lambda model, data: data.qacc + solve_mass_matrix(model, data, data.qfrc_bias)),
    (f"Your accelerations count passive forces (springs, dampers) once more: {AGAIN}.",
     lambda model, data: data.qacc + solve_mass_matrix(model, data, data.qfrc_passive)),
    (f"Your accelerations count the actuators' forces once more: {AGAIN}.",
     lambda model, data: data.qacc + solve_mass_matrix(model, data, data.qfrc_actuator)),
    (("Your accelerations are the forces divided by dof_M0, the diagonal of the mass matrix in the model's first pose: "
     "integrate data.qacc, as mj_forward leaves it."), lambda model, data: data.qfrc_smooth / model.dof_M0),
    ("Your accelerations have the wrong sign: integrate data.qacc as mj_forward leaves it.",
     lambda model, data: -data.qacc),
)  # fmt: skip


def add_to_quaternion(
    model: mujoco.MjModel, qpos: Vector, velocity: Vector, h: float, *, first: int, share: float
) -> Vector:
    """Returns positions whose quaternions have `share` h times the angular velocity added to three of their numbers."""
    moved = move_rightly(model, qpos, velocity, h)
    for joint in find_quaternions(model):
        quat = qpos[joint.qpos : joint.qpos + 4].copy()
        quat[first : first + 3] += share * h * velocity[joint.dof : joint.dof + 3]
        moved[joint.qpos : joint.qpos + 4] = quat / (np.linalg.norm(quat) or 1.0)
    return moved


def turn(
    model: mujoco.MjModel, qpos: Vector, velocity: Vector, h: float, *, factor: float = 1.0, world: bool = False
) -> Vector:
    """Returns positions whose quaternions turn by a multiple of the angle, or from the left."""
    moved = move_rightly(model, qpos, velocity, h)
    for joint in find_quaternions(model):
        quat = qpos[joint.qpos : joint.qpos + 4]
        by = build_turn(factor * h * velocity[joint.dof : joint.dof + 3])
        moved[joint.qpos : joint.qpos + 4] = multiply(by, quat) if world else multiply(quat, by)
    return moved


def differentiate(model: mujoco.MjModel, data: mujoco.MjData, *, share: float, world: bool = False) -> Vector:
    """Returns the change (nq,) of positions in time; that of a quaternion is `share` times a product with (0, w)."""
    changed = move_rightly(model, data.qpos, data.qvel, 1.0) - data.qpos
    for joint in find_quaternions(model):
        quat, omega = data.qpos[joint.qpos : joint.qpos + 4], np.array([0.0, *data.qvel[joint.dof : joint.dof + 3]])
        changed[joint.qpos : joint.qpos + 4] = share * (multiply(omega, quat) if world else multiply(quat, omega))
    return np.array(changed)


def add_change(_: mujoco.MjModel, qpos: Vector, change: Vector, h: float) -> Vector:
    """Returns positions plus h times their change."""
    return np.array(qpos + h * change)


def add_change_and_normalise(model: mujoco.MjModel, qpos: Vector, change: Vector, h: float) -> Vector:
    """Returns positions plus h times their change, each quaternion of length 1."""
    moved = add_change(model, qpos, change, h)
    mujoco.mj_normalizeQuat(model, moved)
    return moved


PRODUCT = "its derivative is quat * (0, omega) / 2, a product of quaternions"

ROTATIONS: Sequence[tuple[str, Mapping[str, Any]]] = (
    *(((f"Your step adds h times the angular velocity to {names} of the quaternion of a free or ball joint, as if it "
        f"were a vector: {PRODUCT}. mj_integratePos does it."),
       {"move": partial(add_to_quaternion, first=first, share=share)})
      for first, share, names in ((1, 1.0, "x, y and z"), (1, 0.5, "x, y and z"), (0, 1.0, "w, x and y"))),
    *(("The quaternion turns twice as fast as it should: its derivative is quat * (0, omega) / 2, with the 1/2.",
       {"rate": partial(differentiate, share=1.0), "move": move}) for move in (add_change, add_change_and_normalise)),
    *((("Your quaternion turns as if the angular velocity were given in the world's axes; it is in the body's axes: "
        "the derivative is quat * (0, omega) / 2."),
       {"rate": partial(differentiate, share=0.5, world=True), "move": move})
      for move in (add_change, add_change_and_normalise)),
    (("The angular velocity of a free or ball joint is given in the body's axes, not the world's: multiply the "
     "quaternion by the rotation from the right."), {"move": partial(turn, world=True)}),
    *((f"Your orientations turn {how}: the quaternion of a turn by an angle holds cos and sin of angle / 2.",
       {"move": partial(turn, factor=factor)})
      for factor, how in ((2.0, "twice as far as they should"), (0.5, "half as far as they should"))),
    (("Your orientations turn backwards: multiply the quaternion from the right by the rotation itself, not by its "
     "conjugate or by a turn of the negative angle."), {"move": partial(turn, factor=-1.0)}),
)  # fmt: skip
