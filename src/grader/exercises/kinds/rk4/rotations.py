"""Reads how a step turns quaternions: predicts every orientation of a trace by each rule, and names the one that fits.

A rule gets the tableau of the velocities and predicts, joint by joint, the quaternions at which mj_forward is asked and
the last one. Quaternions are compared without their sign and length.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product as product_of

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.recorded import Rows, Step
from grader.exercises.kinds.rk4.tableau import CLASSICAL, Matrix, padded, same

EXACT = 1e-11
"""The largest difference of a quaternion from its prediction."""

OFFSETS = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}
"""Where quaternion and angular velocity begin in a joint's coordinates."""


@dataclass(frozen=True)
class Spin:
    """The addresses of one quaternion in qpos, and of its angular velocity in qvel."""

    qpos: int
    dof: int


@dataclass(frozen=True)
class Turning:
    """What a rule may use in one step: quaternions (n + 2, 4) and rates (n + 2, 3) of the start, the calls, the end."""

    quats: Rows
    rates: Rows
    h: float

    def rate(self, row: Sequence[float]) -> Rows:
        """Returns the weighted sum of the calls' rates."""
        calls = len(self.quats) - 2
        return np.array(padded(row, calls) @ self.rates[1 : calls + 1])


Rule = Callable[[Turning, Matrix, int], Rows]
"""(turning, tableau, row) -> the quaternion (4,) after stage `row`, counted from 1; the last row is the result."""


def spins_of(model: mujoco.MjModel) -> list[Spin]:
    """Returns the quaternions of a model."""
    joints = zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist(), strict=True)
    return [Spin(at + OFFSETS[kind], dof + OFFSETS[kind]) for kind, at, dof in joints if kind in OFFSETS]


def product(one: Rows, other: Rows) -> Rows:
    """Returns the product of two quaternions (w, x, y, z)."""
    result = np.zeros(4)
    mujoco.mju_mulQuat(result, one, other)
    return result


def turn_by(vector: Rows) -> Rows:
    """Returns the quaternion of a rotation vector [rad]."""
    angle = float(np.linalg.norm(vector))
    half = np.sin(angle / 2) / angle if angle else 0.5
    return np.array([np.cos(angle / 2), *(half * vector)])


def rotated(quat: Rows, vector: Rows) -> Rows:
    """Returns a vector of the body's axes in the world's."""
    result = np.zeros(3)
    mujoco.mju_rotVecQuat(result, vector, quat)
    return result


def inverse(quat: Rows) -> Rows:
    """Returns the conjugate."""
    return np.array(quat * [1, -1, -1, -1])


def shuffled(quat: Rows) -> Rows:
    """Returns (w, x, y, z) as it is read by code that expects (x, y, z, w)."""
    return np.array([quat[3], quat[0], quat[1], quat[2]])


def unshuffled(quat: Rows) -> Rows:
    """Returns what such code writes, as MuJoCo reads it."""
    return np.array([quat[1], quat[2], quat[3], quat[0]])


def in_the_body(turning: Turning, rows: Matrix, row: int) -> Rows:
    """mj_integratePos: one turn about the weighted mean of the rates."""
    return product(turning.quats[0], turn_by(turning.h * turning.rate(rows[row - 1])))


def in_the_world(turning: Turning, rows: Matrix, row: int) -> Rows:
    """The same turn, from the left."""
    return product(turn_by(turning.h * turning.rate(rows[row - 1])), turning.quats[0])


def times(factor: float) -> Rule:
    """A multiple of the angle: the whole in place of the half, degrees in place of radians, the other way round."""

    def rule(turning: Turning, rows: Matrix, row: int) -> Rows:
        return product(turning.quats[0], turn_by(factor * turning.h * turning.rate(rows[row - 1])))

    return rule


def long_axis(turning: Turning, rows: Matrix, row: int) -> Rows:
    """The angular velocity itself as the axis, which should have length 1."""
    rate, share = turning.rate(rows[row - 1]), sum(rows[row - 1]) or 1.0
    half = turning.h * float(np.linalg.norm(rate)) / 2
    return product(turning.quats[0], np.array([np.cos(half), *(np.sin(half) * rate / share)]))


def read_as_xyzw(turning: Turning, rows: Matrix, row: int) -> Rows:
    """The order (x, y, z, w)."""
    turn = turn_by(turning.h * turning.rate(rows[row - 1]))
    return unshuffled(product(shuffled(turning.quats[0]), turn))


def half_reordered(inward: bool) -> Rule:
    """(x, y, z, w) on the way out of a right product alone, or `inward` on the way into it alone."""

    def rule(turning: Turning, rows: Matrix, row: int) -> Rows:
        if not any(rows[row - 1]):
            return np.array(turning.quats[0])
        turn = turn_by(turning.h * turning.rate(rows[row - 1]))
        if inward:
            return product(shuffled(turning.quats[0]), turn)
        return unshuffled(product(turning.quats[0], turn))

    return rule


def euler_angles(turning: Turning, rows: Matrix, row: int) -> Rows:
    """The rates are added to the angles about the fixed axes x, y, z (roll, pitch, yaw)."""
    w, x, y, z = turning.quats[0] / (np.linalg.norm(turning.quats[0]) or 1.0)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    angles = np.array([roll, pitch, yaw]) + turning.h * turning.rate(rows[row - 1])
    about_x, about_y, about_z = (turn_by(turn) for turn in np.diag(angles))
    return product(about_z, product(about_y, about_x))


def like_numbers(turning: Turning, rows: Matrix, row: int) -> Rows:
    """The rates are added to the first three numbers of the quaternion."""
    moved: Rows = turning.quats[0] + turning.h * np.array([*turning.rate(rows[row - 1]), 0.0])
    return moved


def first_rate(turning: Turning, rows: Matrix, row: int) -> Rows:
    """The derivative with the rate of the start at every stage."""
    return derivative(0.5)(replace(turning, rates=np.tile(turning.rates[0], (len(turning.rates), 1))), rows, row)


def small_angle(turning: Turning, rows: Matrix, row: int) -> Rows:
    """The turn (1, w h / 2), normalised."""
    return product(turning.quats[0], np.array([1.0, *(turning.h / 2 * turning.rate(rows[row - 1]))]))


def rate_turned(inward: bool) -> Rule:
    """The rates are turned from the body's axes into the world's, or the other way round, though they need not be."""

    def rule(turning: Turning, rows: Matrix, row: int) -> Rows:
        calls = len(turning.quats) - 2
        quats = [inverse(quat) if inward else quat for quat in turning.quats[1 : calls + 1]]
        rates = [rotated(quat, rate) for quat, rate in zip(quats, turning.rates[1:], strict=False)]
        mean = padded(rows[row - 1], calls) @ np.array(rates)
        return product(turning.quats[0], turn_by(turning.h * mean))

    return rule


def in_place(last: bool) -> Rule:
    """Each stage turns on from the stage before; `last`: the result too."""

    def rule(turning: Turning, rows: Matrix, row: int) -> Rows:
        is_result = row == len(rows)
        start = turning.quats[0] if is_result and not last else turning.quats[row - 1]
        return product(start, turn_by(turning.h * turning.rate(rows[row - 1])))

    return rule


def one_after_the_other(turning: Turning, rows: Matrix, row: int) -> Rows:
    """The result is turned by one weighted rate after the other."""
    if row < len(rows):
        return in_the_body(turning, rows, row)
    quat: Rows = turning.quats[0]
    for weight, rate in zip(rows[-1], turning.rates[1:], strict=False):
        quat = product(quat, turn_by(turning.h * weight * rate))
    return quat


def derivative(half: float, *, world: bool = False, xyzw: bool = False) -> Rule:
    """The quaternion's own derivative, `half` times quat (0, w), or (0, w) quat in the world's axes."""

    def rule(turning: Turning, rows: Matrix, row: int) -> Rows:
        quats = [shuffled(quat) if xyzw else quat for quat in turning.quats]
        change = np.zeros(4)
        for weight, quat, rate in zip(rows[row - 1], quats[1:], turning.rates[1:], strict=False):
            omega = np.array([0.0, *rate])
            change += weight * half * (product(omega, quat) if world else product(quat, omega))
        found: Rows = quats[0] + turning.h * change
        return unshuffled(found) if xyzw else found

    return rule


BODY = "in the body"
DERIVATIVE = "derivative"

RIGHT: Mapping[str, Rule] = {BODY: in_the_body, DERIVATIVE: derivative(0.5)}
"""Rules that are right: that of MuJoCo 3.14.0, with the classical weights, and one of fourth order."""

WRONG: Mapping[str, Rule] = {
    "The angular velocity of a free or ball joint is given in the body's axes, not the world's: multiply the "
    "quaternion by the rotation from the right.": in_the_world,
    "Your orientations turn by half the angle that they should: the quaternion of a turn by an angle holds cos and sin "
    "of angle / 2, and mj_integratePos and mju_axisAngle2Quat halve it themselves.": times(1 / 2),
    "Your orientations turn twice as far as they should: the quaternion of a turn by an angle holds cos and sin of "
    "angle / 2.": times(2),
    "Your orientations turn backwards: multiply the quaternion from the right by the rotation itself, not by its "
    "conjugate or by a turn of the negative angle.": times(-1),
    "Your turns go into sine and cosine in degrees: h times an angular velocity of MuJoCo is in radians already, so "
    "leave out the conversion.": times(180 / np.pi),
    "Your turns are converted from degrees: h times an angular velocity of MuJoCo is in radians already, so leave out "
    "the conversion.": times(np.pi / 180),
    "The axis of your turns is the angular velocity itself, which is not of length 1: divide it by its norm, and turn "
    "by h times this norm.": long_axis,
    "The quaternion is read as (x, y, z, w): MuJoCo's order is (w, x, y, z), so put w first, or reorder before and "
    "after a library that expects it last.": read_as_xyzw,
    "The quaternion in its derivative is read as (x, y, z, w): MuJoCo's order is (w, x, y, z), so put w first.": (
        derivative(0.5, xyzw=True)
    ),
    "Your quaternions go into a product as (w, x, y, z) and come back into data.qpos as (x, y, z, w): put w first "
    "again before you write them.": half_reordered(inward=False),
    "Your quaternions go into a product as (x, y, z, w) and come back into data.qpos as (w, x, y, z): MuJoCo's order "
    "is (w, x, y, z) on both ways.": half_reordered(inward=True),
    "Your turns add h times the angular velocity to roll, pitch and yaw, but it is not their rate: leave the "
    "quaternion a quaternion, and turn it with mj_integratePos.": euler_angles,
    "The quaternion's derivative takes the angular velocity of the start of the step at every stage: take that of the "
    "stage, quat * (0, omega) / 2 with both from the same stage.": first_rate,
    "Your turns are (1, h w/2), the form for small angles, which is not accurate enough: use mj_integratePos, or cos "
    "and sin of half the angle.": small_angle,
    "Your angular velocities are turned into the world's axes before they turn the quaternion from the right: they are "
    "in the body's axes already, so leave them as they are in data.qvel.": rate_turned(inward=False),
    "Your angular velocities are turned from the world's axes into the body's: they are in the body's axes already, so "
    "leave them as they are in data.qvel.": rate_turned(inward=True),
    "Your stages move the positions in place, so that each starts from those of the stage before; restore qpos to the "
    "start of the step before every stage.": in_place(last=False),
    "The positions are moved in place by every stage and at the end; restore qpos to the start of the step before "
    "every mj_integratePos.": in_place(last=True),
    "The position is moved four times, by one weighted velocity after the other, but rotations do not add up: sum the "
    "velocities first, then move once.": one_after_the_other,
    "Your quaternion turns as if the angular velocity were given in the world's axes; it is in the body's axes, so "
    "the derivative is quat * (0, omega) / 2.": derivative(0.5, world=True),
    "The quaternion turns twice as fast as it should: its derivative is quat * (0, omega) / 2, with the 1/2.": (
        derivative(1.0)
    ),
}
"""The rule behind each sentence."""


def turnings(steps: Sequence[Step], spin: Spin) -> list[Turning]:
    """Returns what each step has of one quaternion."""
    return [
        Turning(step.qpos[:, spin.qpos : spin.qpos + 4], step.qvel[:, spin.dof : spin.dof + 3], step.timestep_s)
        for step in steps
    ]


def fits(rule: Rule, turned: Sequence[Turning], rows: Matrix) -> bool:
    """Whether a rule predicts every orientation."""
    return all(alike(one.quats[row], rule(one, rows, row)) for one in turned for row in range(1, len(rows) + 1))


def alike(one: Rows, other: Rows) -> bool:
    """Whether two quaternions are the same orientation, whatever their signs and lengths."""
    lengths = float(np.linalg.norm(one) * np.linalg.norm(other))
    if not lengths:
        return False
    apart = np.outer(one, other) - np.outer(other, one)
    return bool(np.max(np.abs(apart)) <= EXACT * lengths)


def rule_of(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of the wrong rule by which the quaternions turn, BODY, DERIVATIVE, or None if none fits."""
    every = [turn for spin in spins_of(model) for turn in turnings(steps, spin)]
    rules = {**RIGHT, **WRONG}
    return next((name for name, rule in rules.items() if fits(rule, every, rows)), None)


def sign_turned(row: int, column: int, *, whole: bool) -> Rule:
    """One term with the wrong sign in the quaternion's derivative, or in the product with the `whole` turn.

    Number `row` of a product holds number `column` of the second factor times number `row ^ column` of the first.
    """
    unit = np.eye(4)

    def wrong_product(one: Rows, other: Rows) -> Rows:
        term = product(one * unit[row ^ column], other * unit[column])
        return np.array(product(one, other) - 2 * term)

    def rule(turning: Turning, rows: Matrix, stage: int) -> Rows:
        if whole:
            return wrong_product(turning.quats[0], turn_by(turning.h * turning.rate(rows[stage - 1])))
        slopes = [
            wrong_product(quat / (np.linalg.norm(quat) or 1.0), np.array([0.0, *rate]))
            for quat, rate in zip(turning.quats[1:-1], turning.rates[1:-1], strict=True)
        ]
        change = padded(rows[stage - 1], len(slopes)) @ np.array(slopes)
        found: Rows = turning.quats[0] + turning.h / 2 * change
        return found

    return rule


def wrong_sign(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of a product of quaternions, written out, in which one sign is wrong."""
    every = [turn for spin in spins_of(model) for turn in turnings(steps, spin)]
    for row, column, whole in product_of(range(4), range(4), (False, True)):
        if fits(sign_turned(row, column, whole=whole), every, rows):
            what = "product with the turn" if whole else "quaternion's derivative"
            return (
                f"One sign in your {what} is wrong: in the number {'wxyz'[row]} of the result, that of the "
                f"quaternion's {'wxyz'[row ^ column]} times the other factor's {'wxyz'[column]}. Compare it with "
                "mju_mulQuat, number by number."
            )
    return None


def ends_elsewhere(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of quaternions that turn wrongly in every stage, or at the end alone; None for others."""
    every = [turn for spin in spins_of(model) for turn in turnings(steps, spin)]
    stages = range(1, len(rows))
    rules = (in_the_body, derivative(0.5))
    right = (alike(one.quats[row], rule(one, rows, row)) for rule in rules for one in every for row in stages[1:])
    if same(rows, CLASSICAL) and not any(right):
        return (
            "Your velocities move as they should, but your orientations do not: in your stage 2 the quaternion is not "
            "that of the start of the step, turned by h/2 times the angular velocity. Print it, and compare it with "
            "what mj_integratePos makes of the start."
        )
    if not all(alike(one.quats[row], in_the_body(one, rows, row)) for one in every for row in stages):
        return None
    if all(alike(one.quats[-1], in_the_body(one, rows, len(rows))) for one in every):
        return None
    return (
        "Your stages turn the orientations as mj_integratePos does; the end of your step is not reached by such a turn "
        "of the start. Add up velocities, not quaternions or positions, and move the start of the step by their "
        "weighted mean."
    )
