"""The three planes whose stability is mapped, and the closed form of the limit in each."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.bench.scenes import load_scene
from grader.numerics.scene import Scene
from grader.numerics.servo import Servo

PENDULUM_INERTIA = 0.2501
PENDULUM_GRAVITY_STIFFNESS = 4.905
OMEGA = 100.0
"""Angular frequency of the oscillator [rad/s]; only h * omega matters."""

CLOSED_FORM: dict[str, Callable[[Servo], float]] = {
    "Euler": lambda servo: servo.euler_s,
    "RK4": lambda servo: servo.rk4_s,
    "implicit": lambda servo: servo.implicit_s,
    "implicitfast": lambda servo: servo.implicit_s,
    "discrete": lambda servo: servo.discrete_s,
}


@dataclass(frozen=True)
class Chart:
    """A plane of (parameter, timestep), both on logarithmic axes; `servo` gives the closed forms at a parameter."""

    name: str
    scene: str
    parameter: str
    unit: str
    span: tuple[float, float]
    timestep_span_s: tuple[float, float]
    servo: Callable[[float], Servo]
    timestep_scale: float
    timestep_label: str

    def parameters(self, size: int) -> NDArray[np.float64]:
        """The parameter's grid, ascending, shape (size,)."""
        return np.geomspace(*self.span, size)

    def timesteps_s(self, size: int) -> NDArray[np.float64]:
        """The timestep's grid [s], ascending, shape (size,)."""
        return np.geomspace(*self.timestep_span_s, size)

    def scene_at(self, value: float) -> Scene:
        """The scene with its servo set for this value of the parameter."""
        servo = self.servo(value)

        def set_gains(model: mujoco.MjModel) -> None:
            model.actuator("servo").gainprm[0] = servo.kp
            model.actuator("servo").biasprm[1:3] = -servo.kp, -servo.kv

        return load_scene(self.scene).changed(set_gains)

    def closed_form_s(self, integrator: str, value: float) -> float:
        """The largest stable timestep [s] by the closed form; inf where there is none."""
        return CLOSED_FORM[integrator](self.servo(value))


def pendulum(kp: float, kv: float) -> Servo:
    """The lesson's pendulum under a servo."""
    return Servo(PENDULUM_INERTIA, kp, kv, PENDULUM_GRAVITY_STIFFNESS)


CHARTS = {
    chart.name: chart
    for chart in (
        Chart(
            "stiffness", "servo", "kp", "N m/rad", (100, 40000), (0.001, 0.1), lambda kp: pendulum(kp, 5), 1e3, "h [ms]"
        ),
        Chart(
            "damping", "servo", "kv", "N m s/rad", (0.5, 100), (0.001, 0.2), lambda kv: pendulum(100, kv), 1e3, "h [ms]"
        ),
        Chart(
            "oscillator",
            "oscillator",
            "damping ratio",
            "",
            (0.01, 10),
            (0.1 / OMEGA, 10 / OMEGA),
            lambda zeta: Servo(1.0, OMEGA**2, 2 * zeta * OMEGA),
            OMEGA,
            "h * omega",
        ),
    )
}
