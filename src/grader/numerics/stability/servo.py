"""Closed forms of the linear stability limit of I q'' = -K q - c q', a joint held by a position servo."""

from dataclasses import dataclass
from math import inf, isfinite, sqrt

import numpy as np


@dataclass(frozen=True)
class Servo:
    """A servo: inertia I [kg m2], gains kp [N m/rad] and kv [N m s/rad], stiffness m g L [N m/rad] of gravity at rest.
    Source of the limits: the Jury conditions of each integrator's one-step map, derived beside each. Raises ValueError
    unless the joint is held (K = kp + m g L > 0) and not driven (kp >= 0, kv >= 0), by finite numbers."""

    inertia: float
    kp: float
    kv: float
    gravity_stiffness: float = 0.0

    def __post_init__(self) -> None:
        is_held = self.inertia > 0 and self.stiffness > 0 and self.kp >= 0 and self.kv >= 0
        if not is_held or not all(map(isfinite, (self.inertia, self.kp, self.kv, self.gravity_stiffness))):
            raise ValueError("the closed forms need inertia > 0, kp + m g L > 0, kp >= 0 and kv >= 0, all finite")

    @property
    def stiffness(self) -> float:
        """K = kp + m g L [N m/rad]."""
        return self.kp + self.gravity_stiffness

    @property
    def bound_s(self) -> float:
        """The lesson's 2 sqrt(I / kp), which ignores the damper [s]; inf without a spring."""
        return 2 * sqrt(self.inertia / self.kp) if self.kp else inf

    @property
    def euler_s(self) -> float:
        """Euler, damper explicit: h^2 K + 2 h c < 4 I [s]."""
        I, K, c = self.inertia, self.stiffness, self.kv
        return 4 * I / (sqrt(c * c + 4 * I * K) + c)  # this form of the root does not cancel

    @property
    def implicit_s(self) -> float:
        """implicit and implicitfast, damper implicit: h^2 K < 4 I + 2 h c [s]."""
        I, K, c = self.inertia, self.stiffness, self.kv
        return (sqrt(c * c + 4 * I * K) + c) / K

    @property
    def discrete_s(self) -> float:
        """discrete, servo implicit, gravity explicit: 4 I + 2 h c + h^2 (kp - m g L) > 0 [s]; inf if always."""
        I, c, excess = self.inertia, self.kv, self.gravity_stiffness - self.kp
        return (c + sqrt(c * c + 4 * I * excess)) / excess if excess > 0 else inf

    @property
    def rk4_s(self) -> float:
        """RK4: the first h > 0 at which |R(h lambda)| = 1, R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24 [s]. lambda are the
        roots of I x^2 + c x + K; |R|^2 - 1 is a polynomial in h."""
        limit = inf
        for eigenvalue in np.roots([self.inertia, self.kv, self.stiffness]).astype(complex):
            growth = np.poly1d([eigenvalue**k / f for k, f in ((4, 24), (3, 6), (2, 2), (1, 1), (0, 1))])
            conjugate = np.poly1d(np.conj(growth.coeffs))
            excess = (growth * conjugate).coeffs.real[:-1]  # without the constant: |R(0)| = 1
            scale = abs(eigenvalue)
            roots = np.roots(excess / scale ** np.arange(8, 0, -1)) / scale
            real = roots[(np.abs(roots.imag) < 1e-6 / scale) & (roots.real > 1e-3 / scale)].real
            limit = min(limit, float(real.min(initial=inf)))
        return limit
