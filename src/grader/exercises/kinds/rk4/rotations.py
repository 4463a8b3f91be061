"""Reads how a step turns quaternions: predicts every orientation of a trace by each rule, and names the one that fits.
A rule gets the tableau of the velocities and predicts, joint by joint, the quaternions at which mj_forward is asked and
the last one. Quaternions are compared without their sign and length."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from itertools import product as product_of

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.judging.quaternions import QuaternionAddress, find_quaternions
from grader.exercises.kinds.rk4.step_trace import Rows, Step
from grader.exercises.kinds.rk4.tableau import CLASSICAL, Matrix, is_same, pad_row

EXACT = 1e-11
"""The largest difference of a quaternion from its prediction."""


@dataclass(frozen=True)
class RotationSamples:
    """The samples of one quaternion in one step: `quats` (n + 2, 4) and `rates` (n + 2, 3) of start, calls and end."""

    quats: Rows
    rates: Rows
    h: float

    def sum_rates(self, row: Sequence[float]) -> Rows:
        """Returns the weighted sum of the calls' rates."""
        calls = len(self.quats) - 2
        return np.array(pad_row(row, calls) @ self.rates[1 : calls + 1])


Rule = Callable[[RotationSamples, Matrix, int], Rows]
"""(samples, tableau, row) -> the quaternion (4,) after stage `row`, counted from 1; the last row is the result."""


def sample_all_rotations(model: mujoco.MjModel, steps: Sequence[Step]) -> list[RotationSamples]:
    """Returns the samples of all quaternions of a model in every step."""
    return [samples for address in find_quaternions(model) for samples in sample_rotations(steps, address)]


def multiply(one: Rows, other: Rows) -> Rows:
    """Returns the product of two quaternions (w, x, y, z)."""
    result = np.zeros(4)
    mujoco.mju_mulQuat(result, one, other)
    return result


def build_turn(vector: Rows) -> Rows:
    """Returns the quaternion of a rotation vector [rad]."""
    angle = float(np.linalg.norm(vector))
    half = np.sin(angle / 2) / angle if angle else 0.5
    return np.array([np.cos(angle / 2), *(half * vector)])


def rotate(quat: Rows, vector: Rows) -> Rows:
    """Returns a vector of the body's axes in the world's."""
    result = np.zeros(3)
    mujoco.mju_rotVecQuat(result, vector, quat)
    return result


def conjugate(quat: Rows) -> Rows:
    """Returns the conjugate of a quaternion."""
    return np.array(quat * [1, -1, -1, -1])


def shuffle(quat: Rows) -> Rows:
    """Returns (w, x, y, z) as it is read by code that expects (x, y, z, w)."""
    return np.array([quat[3], quat[0], quat[1], quat[2]])


def unshuffle(quat: Rows) -> Rows:
    """Returns what such code writes, as MuJoCo reads it."""
    return np.array([quat[1], quat[2], quat[3], quat[0]])


def turn_in_body(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Turns as mj_integratePos does: once, about the weighted mean of the rates."""
    return multiply(samples.quats[0], build_turn(samples.h * samples.sum_rates(rows[row - 1])))


def turn_in_world(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Turns by the same rotation, from the left."""
    return multiply(build_turn(samples.h * samples.sum_rates(rows[row - 1])), samples.quats[0])


def make_multiple(factor: float) -> Rule:
    """Turns by a multiple of the angle: the whole in place of the half, degrees in place of radians."""

    def rule(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
        return multiply(samples.quats[0], build_turn(factor * samples.h * samples.sum_rates(rows[row - 1])))

    return rule


def turn_about_long_axis(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Turns about the angular velocity itself, which should have length 1."""
    rate, share = samples.sum_rates(rows[row - 1]), sum(rows[row - 1]) or 1.0
    half = samples.h * float(np.linalg.norm(rate)) / 2
    return multiply(samples.quats[0], np.array([np.cos(half), *(np.sin(half) * rate / share)]))


def turn_as_xyzw(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Turns a quaternion that is read as (x, y, z, w)."""
    turn = build_turn(samples.h * samples.sum_rates(rows[row - 1]))
    return unshuffle(multiply(shuffle(samples.quats[0]), turn))


def make_half_reordered(inward: bool) -> Rule:
    """Reorders to (x, y, z, w) on the way out of a right product alone, or `inward` on the way into it alone."""

    def rule(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
        if not any(rows[row - 1]):
            return np.array(samples.quats[0])
        turn = build_turn(samples.h * samples.sum_rates(rows[row - 1]))
        if inward:
            return multiply(shuffle(samples.quats[0]), turn)
        return unshuffle(multiply(samples.quats[0], turn))

    return rule


def turn_euler_angles(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Adds the rates to the angles about the fixed axes x, y, z (roll, pitch, yaw)."""
    w, x, y, z = samples.quats[0] / (np.linalg.norm(samples.quats[0]) or 1.0)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    angles = np.array([roll, pitch, yaw]) + samples.h * samples.sum_rates(rows[row - 1])
    about_x, about_y, about_z = (build_turn(turn) for turn in np.diag(angles))
    return multiply(about_z, multiply(about_y, about_x))


def add_rates(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Adds the rates to the first three numbers of the quaternion."""
    moved: Rows = samples.quats[0] + samples.h * np.array([*samples.sum_rates(rows[row - 1]), 0.0])
    return moved


def turn_by_first_rate(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Integrates the derivative with the rate of the start at every stage."""
    return make_derivative(0.5)(replace(samples, rates=np.tile(samples.rates[0], (len(samples.rates), 1))), rows, row)


def turn_by_small_angle(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Turns by (1, h w / 2), the form for small angles."""
    return multiply(samples.quats[0], np.array([1.0, *(samples.h / 2 * samples.sum_rates(rows[row - 1]))]))


def make_rotated_rates(inward: bool) -> Rule:
    """Turns the rates from the body's axes into the world's, or the other way round, before they are used."""

    def rule(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
        calls = len(samples.quats) - 2
        quats = [conjugate(quat) if inward else quat for quat in samples.quats[1 : calls + 1]]
        rates = [rotate(quat, rate) for quat, rate in zip(quats, samples.rates[1:], strict=False)]
        mean = pad_row(rows[row - 1], calls) @ np.array(rates)
        return multiply(samples.quats[0], build_turn(samples.h * mean))

    return rule


def make_in_place(last: bool) -> Rule:
    """Turns each stage on from the stage before; `last`: the result too."""

    def rule(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
        is_result = row == len(rows)
        start = samples.quats[0] if is_result and not last else samples.quats[row - 1]
        return multiply(start, build_turn(samples.h * samples.sum_rates(rows[row - 1])))

    return rule


def turn_repeatedly(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
    """Turns the result by one weighted rate after the other."""
    if row < len(rows):
        return turn_in_body(samples, rows, row)
    quat: Rows = samples.quats[0]
    for weight, rate in zip(rows[-1], samples.rates[1:], strict=False):
        quat = multiply(quat, build_turn(samples.h * weight * rate))
    return quat


def make_derivative(half: float, *, world: bool = False, xyzw: bool = False, chained: bool = False) -> Rule:
    """Integrates the quaternion's own derivative, `half` times quat (0, w), or (0, w) quat in the world's axes. With
    `chained` the slopes are those of quaternions that the step has kept, and normalised for MuJoCo alone."""

    def rule(samples: RotationSamples, rows: Matrix, row: int) -> Rows:
        quats = [shuffle(quat) if xyzw else quat for quat in samples.quats]

        def move(weights: Sequence[float], slopes: Sequence[Rows]) -> Rows:
            terms = (weight * slope for weight, slope in zip(weights, slopes, strict=False))
            return np.array(quats[0] + samples.h * sum(terms, np.zeros(4)))

        slopes: list[Rows] = []
        for stage in range(1, row if chained else len(quats) - 1):
            quat, omega = quats[stage], np.array([0.0, *samples.rates[stage]])
            quat = move(rows[stage - 1], slopes) if chained else quat
            slopes.append(half * (multiply(omega, quat) if world else multiply(quat, omega)))
        moved = move(rows[row - 1], slopes)
        return unshuffle(moved) if xyzw else moved

    return rule


BODY = "in the body"
DERIVATIVE = "derivative"
IN_WORLD = (
    "Your quaternion turns as if the angular velocity were given in the world's axes; it is in the body's axes, so "
    "the derivative is quat * (0, omega) / 2."
)
TWICE = "The quaternion turns twice as fast as it should: its derivative is quat * (0, omega) / 2, with the 1/2."
BACKWARDS = (
    "Your quaternion turns backwards: its derivative is quat * (0, omega) / 2, with a plus and the angular velocity as "
    "it is in data.qvel."
)

RIGHT: Mapping[str, Rule] = {BODY: turn_in_body, DERIVATIVE: make_derivative(0.5)}
"""Rules that are right: that of MuJoCo 3.14.0, with the classical weights, and one of fourth order."""

WRONG: Mapping[str, Rule] = {
    "The angular velocity of a free or ball joint is given in the body's axes, not the world's: multiply the "
    "quaternion by the rotation from the right.": turn_in_world,
    "Your orientations turn by half the angle that they should: the quaternion of a turn by an angle holds cos and sin "
    "of angle / 2, and mj_integratePos and mju_axisAngle2Quat halve it themselves.": make_multiple(1 / 2),
    "Your orientations turn twice as far as they should: the quaternion of a turn by an angle holds cos and sin of "
    "angle / 2.": make_multiple(2),
    "Your orientations turn backwards: multiply the quaternion from the right by the rotation itself, not by its "
    "conjugate or by a turn of the negative angle.": make_multiple(-1),
    "Your turns go into sine and cosine in degrees: h times an angular velocity of MuJoCo is in radians already, so "
    "leave out the conversion.": make_multiple(180 / np.pi),
    "Your turns are converted from degrees: h times an angular velocity of MuJoCo is in radians already, so leave out "
    "the conversion.": make_multiple(np.pi / 180),
    "The axis of your turns is the angular velocity itself, which is not of length 1: divide it by its norm, and turn "
    "by h times this norm.": turn_about_long_axis,
    "The quaternion is read as (x, y, z, w): MuJoCo's order is (w, x, y, z), so put w first, or reorder before and "
    "after a library that expects it last.": turn_as_xyzw,
    "The quaternion in its derivative is read as (x, y, z, w): MuJoCo's order is (w, x, y, z), so put w first.": (
        make_derivative(0.5, xyzw=True)
    ),
    "Your quaternions go into a product as (w, x, y, z) and come back into data.qpos as (x, y, z, w): put w first "
    "again before you write them.": make_half_reordered(inward=False),
    "Your quaternions go into a product as (x, y, z, w) and come back into data.qpos as (w, x, y, z): MuJoCo's order "
    "is (w, x, y, z) on both ways.": make_half_reordered(inward=True),
    "Your turns add h times the angular velocity to roll, pitch and yaw, but it is not their rate: leave the "
    "quaternion a quaternion, and turn it with mj_integratePos.": turn_euler_angles,
    "The quaternion's derivative takes the angular velocity of the start of the step at every stage: take that of the "
    "stage, quat * (0, omega) / 2 with both from the same stage.": turn_by_first_rate,
    "Your turns are (1, h w/2), the form for small angles, which is not accurate enough: use mj_integratePos, or cos "
    "and sin of half the angle.": turn_by_small_angle,
    "Your angular velocities are turned into the world's axes before they turn the quaternion from the right: they are "
    "in the body's axes already, so leave them as they are in data.qvel.": make_rotated_rates(inward=False),
    "Your angular velocities are turned from the world's axes into the body's: they are in the body's axes already, so "
    "leave them as they are in data.qvel.": make_rotated_rates(inward=True),
    "Your stages move the positions in place, so that each starts from those of the stage before; restore qpos to the "
    "start of the step before every stage.": make_in_place(last=False),
    "The positions are moved in place by every stage and at the end; restore qpos to the start of the step before "
    "every mj_integratePos.": make_in_place(last=True),
    "The position is moved four times, by one weighted velocity after the other, but rotations do not add up: sum the "
    "velocities first, then move once.": turn_repeatedly,
    IN_WORLD: make_derivative(0.5, world=True),
    TWICE: make_derivative(1.0),
    BACKWARDS: make_derivative(-0.5),
}
"""The rule behind each sentence."""

CHAINED: Mapping[str, Rule] = {
    DERIVATIVE: make_derivative(0.5, chained=True),
    IN_WORLD: make_derivative(0.5, world=True, chained=True),
    TWICE: make_derivative(1.0, chained=True),
    BACKWARDS: make_derivative(-0.5, chained=True),
}
"""The same, of a step that normalises what it gives to MuJoCo, and goes on with what it has."""


def sample_rotations(steps: Sequence[Step], spin: QuaternionAddress) -> list[RotationSamples]:
    """Returns the samples of one quaternion in every step."""
    return [
        RotationSamples(step.qpos[:, spin.qpos : spin.qpos + 4], step.qvel[:, spin.dof : spin.dof + 3], step.timestep_s)
        for step in steps
    ]


def predicts_all(rule: Rule, rotations: Sequence[RotationSamples], rows: Matrix) -> bool:
    """Whether a rule predicts every orientation."""
    return all(predicts(rule, samples, rows, row) for samples in rotations for row in range(1, len(rows) + 1))


def predicts(rule: Rule, samples: RotationSamples, rows: Matrix, row: int) -> bool:
    """Whether a rule predicts the orientation of one row."""
    return is_same_orientation(samples.quats[row], rule(samples, rows, row))


def is_same_orientation(one: Rows, other: Rows) -> bool:
    """Whether two quaternions are the same orientation, whatever their signs and lengths."""
    lengths = float(np.linalg.norm(one) * np.linalg.norm(other))
    if not lengths:
        return False
    return bool(np.max(np.abs(np.outer(one, other) - np.outer(other, one))) <= EXACT * lengths)


def find_rule(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of the wrong rule by which the quaternions turn, BODY, DERIVATIVE, or None if none fits."""
    rotations = sample_all_rotations(model, steps)
    rules = chain(RIGHT.items(), WRONG.items(), CHAINED.items())
    return next((name for name, rule in rules if predicts_all(rule, rotations, rows)), None)


def make_wrong_sign(row: int, column: int, *, whole: bool) -> Rule:
    """Returns the rule with one wrong sign in the quaternion's derivative, or in the product with the `whole` turn.
    Number `row` of a product holds number `column` of the second factor times number `row ^ column` of the first."""
    unit = np.eye(4)

    def multiply_wrongly(one: Rows, other: Rows) -> Rows:
        term = multiply(one * unit[row ^ column], other * unit[column])
        return np.array(multiply(one, other) - 2 * term)

    def rule(samples: RotationSamples, rows: Matrix, stage: int) -> Rows:
        if whole:
            return multiply_wrongly(samples.quats[0], build_turn(samples.h * samples.sum_rates(rows[stage - 1])))
        slopes = [
            multiply_wrongly(quat / (np.linalg.norm(quat) or 1.0), np.array([0.0, *rate]))
            for quat, rate in zip(samples.quats[1:-1], samples.rates[1:-1], strict=True)
        ]
        change = pad_row(rows[stage - 1], len(slopes)) @ np.array(slopes)
        moved: Rows = samples.quats[0] + samples.h / 2 * change
        return moved

    return rule


def explain_wrong_sign(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of a product of quaternions, written out, in which one sign is wrong."""
    rotations = sample_all_rotations(model, steps)
    for row, column, whole in product_of(range(4), range(4), (False, True)):
        if predicts_all(make_wrong_sign(row, column, whole=whole), rotations, rows):
            what = "product with the turn" if whole else "quaternion's derivative"
            return (
                f"One sign in your {what} is wrong: in the number {'wxyz'[row]} of the result, that of the "
                f"quaternion's {'wxyz'[row ^ column]} times the other factor's {'wxyz'[column]}. Compare it with "
                "mju_mulQuat, number by number."
            )
    return None


def explain_wrong_end(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of quaternions that turn wrongly in every stage, or at the end alone; None for others."""
    rotations = sample_all_rotations(model, steps)
    stages = range(1, len(rows))
    rules = (turn_in_body, make_derivative(0.5))
    right = (predicts(rule, rotation, rows, row) for rule in rules for rotation in rotations for row in stages[1:])
    if is_same(rows, CLASSICAL) and not any(right):
        return (
            "Your velocities move as they should, but your orientations do not: in your stage 2 the quaternion is not "
            "that of the start of the step, turned by h/2 times the angular velocity. Print it, and compare it with "
            "what mj_integratePos makes of the start."
        )
    if not all(predicts(turn_in_body, rotation, rows, row) for rotation in rotations for row in stages):
        return None
    if all(predicts(turn_in_body, rotation, rows, len(rows)) for rotation in rotations):
        return None
    return (
        "Your stages turn the orientations as mj_integratePos does; the end of your step is not reached by such a turn "
        "of the start. Add up velocities, not quaternions or positions, and move the start of the step by their "
        "weighted mean."
    )
