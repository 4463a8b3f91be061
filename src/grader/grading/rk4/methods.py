"""Steps of explicit methods, right and believably wrong, over the same mj_forward as the student's."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.grading.drivers.hidden_force import Forward
from grader.numerics.rk4 import STAGES, WEIGHTS

Vector = NDArray[np.float64]
State = tuple[Vector, Vector]
Row = Sequence[float]


@dataclass(frozen=True)
class Motion:
    """Accelerations and position updates of one model."""

    model: mujoco.MjModel
    data: mujoco.MjData
    forward: Forward

    def accelerate(self, q: Vector, v: Vector, time: float) -> Vector:
        """Accelerations (nv,) at a state."""
        self.data.qpos[:], self.data.qvel[:], self.data.time = q, v, time
        self.forward(self.model, self.data)
        return np.array(self.data.qacc)

    def move(self, q: Vector, velocity: Vector, h: float) -> Vector:
        """Positions after `h` [s] at a constant velocity: quaternion-aware."""
        moved = q.copy()
        mujoco.mj_integratePos(self.model, moved, velocity, h)
        return moved


Method = Callable[[Motion, Vector, Vector, float, float], State]
"""(motion, q, v, time, h) -> (q, v) after the step."""


def stepper(method: Method, forward: Forward) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """A method as a function like the student's."""

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        time, h = float(data.time), float(model.opt.timestep)
        q, v = method(Motion(model, data, forward), data.qpos.copy(), data.qvel.copy(), time, h)
        data.qpos[:], data.qvel[:], data.time = q, v, time + h

    return step


def weighed(weights: Row, parts: Sequence[Vector]) -> Vector:
    """The weighted sum of as many parts as there are weights."""
    return np.array(np.add.reduce([w * part for w, part in zip(weights, parts, strict=False)]))


def tableau(stages: Sequence[Row], weights: Row, acceleration_weights: Row | None = None) -> Method:
    """The explicit Runge-Kutta method of a Butcher tableau: row i of `stages` weighs the slopes before stage i + 1.

    `acceleration_weights` are those of a step that weighs accelerations otherwise than velocities.
    """

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        velocities, slopes = [v], [motion.accelerate(q, v, time)]
        for row in stages:
            position = motion.move(q, weighed(row, velocities), h)
            velocity = v + h * weighed(row, slopes)
            velocities.append(velocity)
            slopes.append(motion.accelerate(position, velocity, time + sum(row) * h))
        change = weighed(acceleration_weights or weights, slopes)
        return motion.move(q, weighed(weights, velocities), h), v + h * change

    return step


CLASSICAL_STAGES: tuple[Row, ...] = ((1 / 2,), (0, 1 / 2), (0, 0, 1))
CLASSICAL_WEIGHTS: Row = WEIGHTS


def semi_implicit(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """MuJoCo's Euler without damping: the new velocity moves the position."""
    v = v + h * motion.accelerate(q, v, time)
    return motion.move(q, v, h), v


def classical_slopes(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> tuple[list[Vector], list[Vector]]:
    """Velocities and accelerations of the four classical stages."""
    velocities, slopes = [v], [motion.accelerate(q, v, time)]
    for fraction in STAGES:
        position, velocity = motion.move(q, velocities[-1], fraction * h), v + fraction * h * slopes[-1]
        velocities.append(velocity)
        slopes.append(motion.accelerate(position, velocity, time + fraction * h))
    return velocities, slopes


def position_by_new_velocity(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """Velocities by the classical method, positions by the new velocity alone."""
    v = v + h * weighed(CLASSICAL_WEIGHTS, classical_slopes(motion, q, v, time, h)[1])
    return motion.move(q, v, h), v


def position_by_old_velocity(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """Velocities by the classical method, positions by the velocity at the step's start."""
    slopes = classical_slopes(motion, q, v, time, h)[1]
    return motion.move(q, v, h), v + h * weighed(CLASSICAL_WEIGHTS, slopes)


def four_moves(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """The weighted velocities move the position one after the other, in four calls of mj_integratePos."""
    velocities, slopes = classical_slopes(motion, q, v, time, h)
    for weight, velocity in zip(CLASSICAL_WEIGHTS, velocities, strict=True):
        q = motion.move(q, velocity, weight * h)
    return q, v + h * weighed(CLASSICAL_WEIGHTS, slopes)


def staged(
    stage: Callable[[Motion, State, State, tuple[Vector, Vector], float], State], fractions: Row = STAGES
) -> Method:
    """The classical method with another rule for where a stage starts: from the step's start, the stage before it
    and that stage's slope (velocity, acceleration), over a part of the step."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        here: State = (q, v)
        velocities, slopes = [v], [motion.accelerate(q, v, time)]
        for fraction in fractions:
            here = stage(motion, (q, v), here, (velocities[-1], slopes[-1]), fraction * h)
            velocities.append(here[1])
            slopes.append(motion.accelerate(*here, time + fraction * h))
        weights = CLASSICAL_WEIGHTS
        return motion.move(q, weighed(weights, velocities), h), v + h * weighed(weights, slopes)

    return step


def own_new_velocity(motion: Motion, start: State, here: State, slope: tuple[Vector, Vector], part: float) -> State:
    """Semi-implicit: a stage's position moves with that stage's own velocity."""
    velocity = start[1] + part * slope[1]
    return motion.move(start[0], velocity, part), velocity


def first_velocity(motion: Motion, start: State, here: State, slope: tuple[Vector, Vector], part: float) -> State:
    """A stage's position moves with the velocity at the step's start."""
    return motion.move(start[0], start[1], part), start[1] + part * slope[1]


def chained(motion: Motion, start: State, here: State, slope: tuple[Vector, Vector], part: float) -> State:
    """A stage starts where the one before it stood."""
    return motion.move(here[0], slope[0], part), here[1] + part * slope[1]


def chained_positions(motion: Motion, start: State, here: State, slope: tuple[Vector, Vector], part: float) -> State:
    """Only the positions start where the stage before stood: mj_integratePos in place."""
    return motion.move(here[0], slope[0], part), start[1] + part * slope[1]


def chained_to_the_end(positions: bool = True, velocities: bool = True) -> Method:
    """Stages and the final update go on from where the last one stood: positions, velocities or both are never put
    back."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        speeds, slopes = [v], [motion.accelerate(q, v, time)]
        position, velocity = q, v
        for fraction in STAGES:
            position = motion.move(position if positions else q, speeds[-1], fraction * h)
            velocity = (velocity if velocities else v) + fraction * h * slopes[-1]
            speeds.append(velocity)
            slopes.append(motion.accelerate(position, velocity, time + fraction * h))
        last, speed = position if positions else q, velocity if velocities else v
        weights = CLASSICAL_WEIGHTS
        return motion.move(last, weighed(weights, speeds), h), speed + h * weighed(weights, slopes)

    return step
