"""Equations of motion by hand for the scenes where a user of SciPy would write them down.

States are (qpos, qvel) as in MuJoCo, so that all peers answer in the same coordinates.
"""

from collections.abc import Callable
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Derivative = Callable[[float, Array], list[float]]

GRAVITY = 9.81


def double_pendulum(_t: float, state: Array) -> list[float]:
    """Two point masses of 1 kg (own inertia 1e-4) on links of 0.3 m; state (q1, q2, v1, v2), the second relative.

    Lagrange's equations in the absolute angles a = q1 and b = q1 + q2.
    """
    q1, q2, v1, v2 = state
    mass, length, own = 1.0, 0.3, 1e-4
    square = mass * length**2
    coupling, swirl = square * cos(q2), square * sin(q2)
    b, vb = q1 + q2, v1 + v2
    upper = swirl * vb * vb - 2 * mass * GRAVITY * length * sin(q1)
    lower = -swirl * v1 * v1 - mass * GRAVITY * length * sin(b)
    m11, m22 = 2 * square + own, square + own
    determinant = m11 * m22 - coupling * coupling
    a1 = (m22 * upper - coupling * lower) / determinant
    ab = (m11 * lower - coupling * upper) / determinant
    return [v1, v2, a1, ab - a1]


def servo_with(kp: float, kv: float) -> Derivative:
    """A pendulum (1 kg, 0.5 m, own inertia 1e-4) under the torque -kp q - kv v; state (q, v)."""
    mass, length = 1.0, 0.5
    inertia = mass * length**2 + 1e-4

    def derivative(_t: float, state: Array) -> list[float]:
        q, v = state
        return [v, (-kp * q - kv * v - mass * GRAVITY * length * sin(q)) / inertia]

    return derivative


def spinning_body(_t: float, state: Array) -> list[float]:
    """A torque-free rigid body: Euler's equations in the body's frame and the quaternion's derivative q (0, w) / 2.

    State (position, quaternion w x y z, velocity, angular velocity in the body's frame), inertia (0.01, 0.02, 0.03).
    """
    _x, _y, _z, w, i, j, k, u1, u2, u3, p, q, r = state
    one, two, three = 0.01, 0.02, 0.03
    return [
        *(u1, u2, u3),
        (-i * p - j * q - k * r) / 2,
        (w * p + j * r - k * q) / 2,
        (w * q + k * p - i * r) / 2,
        (w * r + i * q - j * p) / 2,
        *(0.0, 0.0, 0.0),
        (two - three) * q * r / one,
        (three - one) * r * p / two,
        (one - two) * p * q / three,
    ]


EQUATIONS: dict[str, Derivative] = {
    "double_pendulum": double_pendulum,
    "servo": servo_with(100, 5),
    "stiff_servo": servo_with(20000, 5),
    "spinning_body": spinning_body,
}
