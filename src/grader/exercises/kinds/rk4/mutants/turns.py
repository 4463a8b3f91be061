"""Quaternions that turn by a rule with one or two mistakes: which side, which axes, which angle, which order of the
numbers. All rules are tried on the orientations of a trace."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations
from math import pi
from typing import Any

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.rotations import (
    RotationSamples,
    build_turn,
    conjugate,
    multiply,
    predicts_all,
    rotate,
    sample_all_rotations,
    shuffle,
    unshuffle,
)
from grader.exercises.kinds.rk4.step_trace import Rows, Step
from grader.exercises.kinds.rk4.tableau import Matrix


def keep(quat: Rows) -> Rows:
    """Returns a quaternion as it is."""
    return quat


Change = Callable[[Rows], Rows]


@dataclass(frozen=True)
class TurnRule:
    """Turns by the weighted mean of the rates; the defaults are right."""

    from_left: bool = False
    axes: str = "own"
    """The rates as they are, or turned to "world" or "body" axes by the orientation at the start of the step."""
    factor: float = 1.0
    read: Change = keep
    turn: Change = keep
    write: Change = keep

    def __call__(self, samples: RotationSamples, rows: Matrix, row: int) -> Rows:
        """Returns the quaternion after a row of the tableau."""
        if not any(rows[row - 1]):
            return np.array(samples.quats[0])
        start = samples.quats[0] / (np.linalg.norm(samples.quats[0]) or 1.0)
        rate = samples.sum_rates(rows[row - 1])
        if self.axes != "own":
            rate = rotate(start if self.axes == "world" else conjugate(start), rate)
        turn = self.turn(build_turn(self.factor * samples.h * rate))
        quat = self.read(start)
        return self.write(multiply(turn, quat) if self.from_left else multiply(quat, turn))


WXYZ = "MuJoCo's order is (w, x, y, z)"

MISTAKES: Sequence[tuple[str, Mapping[str, Any]]] = (
    (("The angular velocity of a free or ball joint is given in the body's axes, not the world's: multiply the "
      "quaternion by the rotation from the right."), {"from_left": True}),
    (("Your angular velocities are turned into the world's axes before they turn the quaternion: they are in the "
      "body's axes, as the product from the right needs them, so leave them as they are in data.qvel."),
     {"axes": "world"}),
    (("Your angular velocities are turned from the world's axes into the body's: they are in the body's axes already, "
      "so leave them as they are in data.qvel."), {"axes": "body"}),
    (("Your orientations turn twice as far as they should: the quaternion of a turn by an angle holds cos and sin of "
      "angle / 2."), {"factor": 2.0}),
    (("Your orientations turn half as far as they should: the quaternion of a turn by an angle holds cos and sin of "
      "angle / 2."), {"factor": 0.5}),
    (("Your orientations turn backwards: multiply by the rotation itself, not by its conjugate or by a turn of the "
      "negative angle."), {"factor": -1.0}),
    ("Your turns are converted from radians to degrees: sine and cosine take radians.", {"factor": 180 / pi}),
    ("Your turns are converted from degrees: h times an angular velocity of MuJoCo is in radians already.",
     {"factor": pi / 180}),
    (f"The quaternion of your turn is written as (x, y, z, w): {WXYZ}, so put the cosine first.", {"turn": unshuffle}),
    (f"Your product takes the quaternion in data.qpos as (x, y, z, w): {WXYZ}.", {"read": shuffle}),
    (f"Your product is written into data.qpos as (x, y, z, w): {WXYZ}.", {"write": unshuffle}),
)  # fmt: skip
"""The sentence of each mistake, and what it changes."""


def list_rules() -> Iterator[tuple[str, TurnRule]]:
    """Yields each rule with one mistake, then with two, and what is said of it."""
    for sentence, change in MISTAKES:
        yield sentence, replace(TurnRule(), **change)
    for (first, one), (second, other) in combinations(MISTAKES, 2):
        if not {*one} & {*other}:
            yield f"Two things are wrong. First: {first} Second: {second}", replace(TurnRule(), **one, **other)


RULES = tuple(list_rules())

assert {name for _, change in MISTAKES for name in change} <= {field.name for field in fields(TurnRule)}


def explain_turns(model: mujoco.MjModel, steps: Sequence[Step], rows: Matrix) -> str | None:
    """Returns the sentence of the rule by which all quaternions turn from the start of the step; None if none does."""
    rotations = sample_all_rotations(model, steps)
    return next((sentence for sentence, rule in RULES if predicts_all(rule, rotations, rows)), None)
