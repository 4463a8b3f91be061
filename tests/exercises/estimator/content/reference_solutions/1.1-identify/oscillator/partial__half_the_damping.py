# diagnosis: Your damping is half of the true one
import numpy as np


def waves(rate, omega, t):
    return np.exp(-rate * t) * np.array([np.cos(omega * t), np.sin(omega * t)])


def residual(p, t, x):
    basis = waves(*p, t).T
    return x - basis @ np.linalg.lstsq(basis, x, rcond=None)[0]


def fit(t, x):
    sizes = [(np.sum(residual((r, w), t, x) ** 2), r, w) for r in (0.2, 0.5, 1.0, 1.5) for w in np.linspace(3, 16, 40)]
    p = np.array(min(sizes)[1:])
    for _ in range(8):
        r = residual(p, t, x)
        jacobian = np.array([(residual(p + step, t, x) - r) / 1e-6 for step in 1e-6 * np.eye(2)]).T
        p = p - np.linalg.lstsq(jacobian, r, rcond=None)[0]
    return p


def estimate(model, times, positions):
    mass = model.body("cart").mass[0]
    rate, omega = fit(times, positions)
    return {"stiffness": mass * (omega**2 + rate**2), "damping": mass * rate}
