"""Stability regions of the five integrators in the complex plane: closed forms, checked by simulation in and out. The
test equation is a held joint, q'' = 2 Re(l) q' - |l|^2 q, with the conjugate eigenvalues l and conj(l); a point of the
plane is z = h l. All but RK4 treat positions and velocities differently, so that a single eigenvalue says nothing."""

from cmath import rect
from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, isfinite, radians
from typing import Any

import mujoco
import numpy as np
from matplotlib.figure import Figure

from grader.numerics.integrators import BY_NAME
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.stability.linear import compute_spectral_radius
from grader.numerics.stability.servo import Servo
from grader.studies.bench.scenes import load_scene
from grader.studies.bench.study import Measurement, Record, Records, Study, select_kind

ANGLES = tuple(range(95, 180, 10))
"""Arguments of z [degrees], from nearly undamped to nearly critically damped."""

FACTORS = (0.5, 0.9, 0.98, 1.02, 1.1, 2.0)
"""Distances from 0 in multiples of the limit: three points in, three out."""

FREE_RADII = (0.5, 2.0, 8.0)
"""Distances from 0 where a method has no limit."""

STEPS = 2000
"""Steps simulated at each point; 2 % beyond a limit the motion then grows more than a hundredfold."""

SERVOS = {
    "servo of the lesson": Servo(0.2501, 100, 5, 4.905),
    "kp = 2000": Servo(0.2501, 2000, 5, 4.905),
    "kp = 20000": Servo(0.2501, 20000, 5, 4.905),
}
"""The pendulum of the maps under three stiffnesses, with gravity at its rest."""


def compute_eigenvalue(servo: Servo) -> complex:
    """Returns the eigenvalue of I q'' = -K q - c q' in the upper half plane [1/s]."""
    return complex(
        max(np.roots([servo.inertia, servo.kv, servo.stiffness]).astype(complex), key=lambda root: root.imag)
    )


def compute_growth(integrator: str, z: complex) -> float:
    """Growth per step of the motion with the eigenvalues z and conj(z), times the timestep. Source: RK4 by its
    stability polynomial. The others update v by its force, explicit or implicit, and then q by the new v: derived by
    writing out one step of (q, h v), with a = -2 Re z for the damper and b = |z|^2 for the spring."""
    if integrator == "RK4":
        return abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)
    a, b = -2 * z.real, abs(z) ** 2
    if integrator == "Euler":
        velocity = (-b, 1 - a)
    else:
        mass = 1 + a + (b if integrator == "discrete" else 0)
        velocity = (-b / mass, 1 / mass)
    step = np.array([[1 + velocity[0], velocity[1]], velocity])
    return float(np.abs(np.linalg.eigvals(step)).max())


def find_limit(integrator: str, angle: float) -> float:
    """Returns the distance from 0 at which the region ends along an angle [degrees]; inf where it does not."""
    held = Servo(1.0, 1.0, -2 * cos(radians(angle)))
    limits = {"Euler": held.euler_s, "RK4": held.rk4_s, "discrete": held.discrete_s}
    return limits.get(integrator, held.implicit_s)


def build_held_joint(z: complex) -> Scene:
    """Returns the oscillator whose eigenvalues are z and its conjugate at a timestep of 1 s."""

    def set_gains(model: mujoco.MjModel) -> None:
        model.actuator("servo").gainprm[0] = abs(z) ** 2
        model.actuator("servo").biasprm[1:3] = -(abs(z) ** 2), 2 * z.real

    return load_scene("oscillator").changed(set_gains)


def grows(scene: Scene, integrator: str) -> bool:
    """Whether the simulated motion is larger in the last of STEPS steps than at the start, or a step warned."""
    run = simulate(scene, steps=STEPS, timestep_s=1.0, integrator=BY_NAME[integrator].code)
    if run.diverged_at_step is not None:
        return True
    size = np.hypot(run.qpos[:, 0], run.qvel[:, 0] / (abs(scene.model.actuator("servo").gainprm[0]) ** 0.5))
    return bool(size[-STEPS // 4 :].max() > size[0])


@dataclass(frozen=True)
class Ray(Measurement):
    """Points of one integrator along one angle [degrees]."""

    timed = False
    integrator: str
    angle: int

    def measure(self, quick: bool, done: Records) -> Record:
        """At each point: growth by closed form, spectral radius of MuJoCo's step, and what the simulation does."""
        end = find_limit(self.integrator, self.angle)
        radii = [end * factor for factor in FACTORS] if isfinite(end) else list(FREE_RADII)
        points = []
        for radius in radii:
            z = rect(radius, radians(self.angle))
            scene = build_held_joint(z)
            code = BY_NAME[self.integrator].code
            by_step = compute_spectral_radius(scene.at(qpos=[0.0]), timestep_s=1.0, integrator=code)
            growth = {"closed": compute_growth(self.integrator, z), "spectral": by_step}
            points.append({"radius": radius, "inside": radius < end, **growth, "grows": grows(scene, self.integrator)})
        return {"limit": end if isfinite(end) else None, "points": points}

    def rows(self, record: Record) -> list[Record]:
        """Returns one row a point."""
        return list(record["points"])


def plan(_quick: bool) -> Sequence[Measurement]:
    """Returns every integrator along every angle."""
    return [Ray(kind, angle) for kind in BY_NAME for angle in ANGLES]


def summarise(records: Records) -> Record:
    """Limits by angle, the largest distance of closed form and MuJoCo's step, wrong points, and the servos."""
    rays = select_kind(records, Ray)
    points = [point for record in rays.values() for point in record["points"]]
    return {
        "limits": {kind: {str(angle): rays[Ray(kind, angle)]["limit"] for angle in ANGLES} for kind in BY_NAME},
        "points": len(points),
        "largest_difference": max(
            abs(point["closed"] - point["spectral"]) / max(1.0, point["closed"]) for point in points
        ),
        "wrong": sum(
            point["grows"] is point["inside"] or (point["closed"] <= 1) is not point["inside"] for point in points
        ),
        "servos": {name: summarise_servo(servo) for name, servo in SERVOS.items()},
    }


def summarise_servo(servo: Servo) -> Record:
    """The eigenvalue [1/s] and the largest stable timesteps [s] of each integrator, None where there is no limit."""
    limits = dict.fromkeys(BY_NAME, servo.implicit_s)
    limits |= {"Euler": servo.euler_s, "RK4": servo.rk4_s, "discrete": servo.discrete_s}
    eigenvalue = compute_eigenvalue(servo)
    return {
        "eigenvalue": [eigenvalue.real, eigenvalue.imag],
        "limits_s": {kind: h if isfinite(h) else None for kind, h in limits.items()},
    }


COLOURS = {"Euler": "#4477aa", "RK4": "#ee6677", "implicit": "#228833", "implicitfast": "#228833"}
WINDOW = (-6.5, 0.6, 4.6)
"""What is drawn of the plane: least and largest real part, largest imaginary part."""


def draw(records: Records, summary: Record) -> Figure:
    """The borders of the regions, the points that were simulated, and the servos' eigenvalues at growing timesteps."""
    figure = Figure(figsize=(9.5, 6))
    axes = figure.subplots()
    real, imaginary = np.meshgrid(np.linspace(WINDOW[0], 0, 260), np.linspace(1e-3, WINDOW[2], 180))
    for kind in ("Euler", "RK4", "implicit"):
        values = np.array([compute_growth(kind, complex(*z)) for z in zip(real.flat, imaginary.flat, strict=True)])
        axes.contour(real, imaginary, values.reshape(real.shape), levels=[1.0], colors=COLOURS[kind])
        label = {"implicit": "implicit and implicitfast"}.get(kind, kind)
        axes.plot([], [], color=COLOURS[kind], label=label)
    axes.axvline(0, color="#aa3377", label="discrete: the whole left half plane")
    for grown, marker in ((False, "o"), (True, "x")):
        draw_points(axes, records, grown, marker)
    for name, dash in zip(SERVOS, ("-", "--", ":"), strict=True):
        z = complex(*summary["servos"][name]["eigenvalue"])
        label = f"h times eigenvalue, {name}"
        axes.plot([0, 1e3 * z.real], [0, 1e3 * z.imag], dash, color="black", lw=0.8, label=label)
        steps_s = [h for h in (0.002, 0.004, 0.008, 0.016, 0.032) if abs(h * z.imag) < WINDOW[2] - 0.3]
        axes.plot([h * z.real for h in steps_s], [h * z.imag for h in steps_s], ".", color="black", ms=5)
        last = (steps_s[-1] * z.real, steps_s[-1] * z.imag)
        axes.annotate(f"{1e3 * steps_s[-1]:.0f} ms", last, (4, 2), textcoords="offset points")
    axes.set(xlim=WINDOW[:2], ylim=(0, WINDOW[2]), xlabel="Re(h l)", ylabel="Im(h l)")
    axes.legend(loc="upper left", fontsize=8)
    return figure


def draw_points(axes: Any, records: Records, grown: bool, marker: str) -> None:
    """The points whose simulation grew, or did not, in the colour of their integrator."""
    for key, record in select_kind(records, Ray).items():
        if key.integrator not in COLOURS:
            continue
        drawn = [rect(p["radius"], radians(key.angle)) for p in record["points"] if p["grows"] is grown]
        colour = COLOURS[key.integrator]
        axes.plot([z.real for z in drawn], [z.imag for z in drawn], marker, color=colour, ms=3.5, mfc="none", mew=0.8)
    label = "simulated: grows" if grown else "simulated: does not grow"
    axes.plot([], [], marker, color="#555555", ms=3.5, mfc="none", label=label)


STUDY = Study("regions", plan, summarise, {"regions": draw})
