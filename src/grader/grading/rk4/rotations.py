"""Steps that treat rotations in another way than by one mj_integratePos."""

from collections.abc import Callable

import mujoco
import numpy as np

from grader.grading.rk4.methods import CLASSICAL_WEIGHTS, Method, Motion, State, Vector, weighed
from grader.numerics.rk4 import STAGES

Rate = Callable[[Vector, Vector], Vector]


class WorldMotion(Motion):
    """Takes the angular velocity of a free or ball joint as if it were given in the world's axes."""

    def move(self, q: Vector, velocity: Vector, h: float) -> Vector:
        """Positions after `h` [s], quaternions turned from the wrong side."""
        moved = super().move(q, velocity, h)
        for kind, at, dof in zip(self.model.jnt_type, self.model.jnt_qposadr, self.model.jnt_dofadr, strict=True):
            if int(kind) in QUATERNION:
                quat, spin = at + QUATERNION[int(kind)], dof + QUATERNION[int(kind)]
                rate = velocity[spin : spin + 3]
                angle = float(np.linalg.norm(rate))
                turn = np.zeros(4)
                mujoco.mju_axisAngle2Quat(turn, rate / angle if angle else np.array([1.0, 0.0, 0.0]), h * angle)
                mujoco.mju_mulQuat(moved[quat : quat + 4], turn, q[quat : quat + 4])
        return moved


QUATERNION = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}
"""Where quaternion and angular velocity begin in a joint's coordinates."""


def in_the_world(method: Method) -> Method:
    """A method with angular velocities taken in the world's axes."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        return method(WorldMotion(motion.model, motion.data, motion.forward), q, v, time, h)

    return step


def quaternion_derivative(rate: Rate) -> Method:
    """The classical method on qpos itself; `rate`: of a quaternion (4,), from it and an angular velocity (3,)."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        velocities, rates, slopes = [v], [qpos_rate(motion, rate, q, v)], [motion.accelerate(q, v, time)]
        for fraction in STAGES:
            position, velocity = q + fraction * h * rates[-1], v + fraction * h * slopes[-1]
            velocities.append(velocity)
            rates.append(qpos_rate(motion, rate, position, velocity))
            slopes.append(motion.accelerate(position, velocity, time + fraction * h))
        position = q + h * weighed(CLASSICAL_WEIGHTS, rates)
        mujoco.mj_normalizeQuat(motion.model, position)
        return position, v + h * weighed(CLASSICAL_WEIGHTS, slopes)

    return step


def qpos_rate(motion: Motion, rate: Rate, q: Vector, v: Vector) -> Vector:
    """The rate of change of qpos (nq,)."""
    result, model = np.zeros(len(q)), motion.model
    for kind, at, dof in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True):
        plain = QUATERNION.get(int(kind), 1)
        result[at : at + plain] = v[dof : dof + plain]
        if int(kind) in QUATERNION:
            quat, spin = at + plain, dof + plain
            result[quat : quat + 4] = rate(q[quat : quat + 4], v[spin : spin + 3])
    return result


def rate_in_the_world(quat: Vector, omega: Vector) -> Vector:
    """(0, omega) * quat / 2: right for an angular velocity in the world's axes."""
    rate = np.zeros(4)
    mujoco.mju_derivQuat(rate, quat, omega)
    return rate


def rate_without_the_half(quat: Vector, omega: Vector) -> Vector:
    """quat * (0, omega)."""
    rate = np.zeros(4)
    mujoco.mju_mulQuat(rate, quat, np.concatenate([[0.0], omega]))
    return rate
