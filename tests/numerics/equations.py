"""The lesson's pendulums by hand: a second source beside mj_forward. Angles from hanging straight down [rad]."""

from dataclasses import dataclass
from math import cos, sin

GRAVITY = 9.81


@dataclass(frozen=True)
class Pendulum:
    """I q'' = -m g L sin q. Source: moment balance about the hinge. Units kg m2, kg, m."""

    inertia: float = 0.2501
    mass: float = 1.0
    length: float = 0.5

    def acceleration(self, q: float, torque: float = 0.0) -> float:
        """q'' [rad/s2] under a motor torque [N m]."""
        return (torque - self.mass * GRAVITY * self.length * sin(q)) / self.inertia


@dataclass(frozen=True)
class DoublePendulum:
    """Two equal links, a point mass with own inertia at the end of each; the second angle is relative to the first.

    Source: Lagrange's equations in the absolute angles a = q1, b = q1 + q2. Units kg, m, kg m2.
    """

    mass: float = 1.0
    length: float = 0.3
    own_inertia: float = 1e-4

    def acceleration(self, q1: float, q2: float, v1: float, v2: float) -> tuple[float, float]:
        """(q1'', q2'') [rad/s2]."""
        m, L, g = self.mass, self.length, GRAVITY
        a, b, va, vb = q1, q1 + q2, v1, v1 + v2
        m11, m22 = 2 * m * L * L + self.own_inertia, m * L * L + self.own_inertia
        m12, coupling = m * L * L * cos(a - b), m * L * L * sin(a - b)
        f1 = -coupling * vb * vb - 2 * m * g * L * sin(a)
        f2 = coupling * va * va - m * g * L * sin(b)
        determinant = m11 * m22 - m12 * m12
        aa = (m22 * f1 - m12 * f2) / determinant
        ab = (m11 * f2 - m12 * f1) / determinant
        return aa, ab - aa
