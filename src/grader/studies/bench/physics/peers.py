"""What a user would pick instead: the lesson's Python loop, plain mj_step with nstep, SciPy, Pinocchio,
Drake. A peer's `run` integrates a scene with one setting, a timestep [s] or a tolerance, and returns qpos at the times,
shape (len(times), nq), in MuJoCo's coordinates. Pinocchio and Drake run where the extra `peers` is installed."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from math import cos, sin
from typing import Any, Literal

import mujoco
import numpy as np
import scipy
from numpy.typing import NDArray

from grader.numerics.accuracy.reference import Method, build_rate
from grader.numerics.integrators import BY_NAME, EULER
from grader.numerics.scene import Scene
from grader.studies.bench.scenes import find_scene, load_scene
from grader.studies.bench.timing import restore_timer

Array = NDArray[np.float64]
Run = Callable[[float, Array], Array]
Derivative = Callable[[float, Array], list[float]]

GRAVITY = 9.81
PINOCCHIO_SCENES = ("double_pendulum", "servo", "stiff_servo", "spinning_body")
DRAKE_SCENES = ("double_pendulum", "spinning_body")
GAINS = {"servo": (100.0, 5.0), "stiff_servo": (20000.0, 5.0)}
"""kp [N m/rad] and kv [N m s/rad] of the scenes with a servo."""


@dataclass(frozen=True)
class Peer:
    """One alternative on one scene."""

    run: Run
    setting: Literal["timestep", "tolerance"]


@cache
def find_peers(name: str) -> dict[str, Peer]:
    """Returns the peers of a scene that this machine has, by name."""
    scene = load_scene(name)
    peers = {f"Python loop, {kind}": Peer(make_python_loop(scene, kind), "timestep") for kind in ("Euler", "RK4")}
    peers |= {f"mj_step(nstep), {kind}": Peer(make_nstep(scene, kind), "timestep") for kind in ("Euler", "RK4")}
    methods: tuple[Method, Method] = ("LSODA", "DOP853")
    for method in methods:
        if name in EQUATIONS:
            peers[f"SciPy {method}, by hand"] = Peer(make_by_hand(name, scene, method), "tolerance")
        peers[f"SciPy {method}, mj_forward"] = Peer(make_over_mj_forward(scene, method), "tolerance")
    if name in PINOCCHIO_SCENES and find_spec("pinocchio"):
        peers["Pinocchio ABA + RK4"] = Peer(pinocchio_rk4(name, scene), "timestep")
    if name in DRAKE_SCENES and find_spec("pydrake"):
        peers["Drake RK5"] = Peer(drake_rk5(name, scene), "tolerance")
    return peers


def make_python_loop(scene: Scene, integrator: str) -> Run:
    """Returns the lesson's loop: one `mj_step` per call from Python, with the wheel's timer and nothing skipped."""

    def advance(model: mujoco.MjModel, data: mujoco.MjData, steps: int) -> None:
        for _ in range(steps):
            mujoco.mj_step(model, data)

    run = make_plain(scene, integrator, advance)

    def run_timed(timestep_s: float, times: Array) -> Array:
        with restore_timer():
            return run(timestep_s, times)

    return run_timed


def make_nstep(scene: Scene, integrator: str) -> Run:
    """Returns plain MuJoCo in C: one call of `mj_step` with nstep between two times, the timer off, nothing skipped."""
    return make_plain(scene, integrator, mujoco.mj_step)


def make_plain(scene: Scene, integrator: str, advance: Callable[[mujoco.MjModel, mujoco.MjData, int], None]) -> Run:
    """Returns a run in which `advance` takes so many steps from one time to the next."""
    with scene.borrow(integrator=BY_NAME[integrator].code, keep=False) as workspace:
        model, data = workspace.model, workspace.data
    start = scene.start

    def run(timestep_s: float, times: Array) -> Array:
        model.opt.timestep = timestep_s
        mujoco.mj_resetData(model, data)
        data.qpos, data.qvel = start.qpos, start.qvel
        samples = np.empty((len(times), model.nq))
        samples[0] = data.qpos
        for row in range(1, len(times)):
            advance(model, data, round((times[row] - times[row - 1]) / timestep_s))
            samples[row] = data.qpos
        return samples

    return run


def make_by_hand(name: str, scene: Scene, method: Method) -> Run:
    """SciPy on the equations of motion that the user derived."""
    state = np.concatenate([scene.start.qpos, scene.start.qvel])
    return make_adaptive(EQUATIONS[name], state, len(scene.start.qpos), method)


def make_over_mj_forward(scene: Scene, method: Method) -> Run:
    """SciPy with accelerations from `mj_forward`, constraint forces included."""
    with scene.borrow(integrator=EULER.code, keep=False, skip=True) as workspace:
        model, data = workspace.model, workspace.data
    run = make_adaptive(build_rate(workspace), np.concatenate([data.qpos, data.qvel, data.act]), int(model.nq), method)

    def afresh(tolerance: float, times: Array) -> Array:
        mujoco.mj_resetData(model, data)  # the warm start of the last run
        return run(tolerance, times)

    return afresh


def make_adaptive(rate: Callable[[float, Array], Any], state: Array, nq: int, method: Method) -> Run:
    """SciPy with rtol = tolerance and atol a tenth of it; raises RuntimeError where it gives up."""

    def run(tolerance: float, times: Array) -> Array:
        span = (times[0], times[-1])
        solution = scipy.integrate.solve_ivp(rate, span, state, method, times, rtol=tolerance, atol=tolerance / 10)
        if not solution.success:
            raise RuntimeError(str(solution.message))
        return np.asarray(solution.y.T[:, :nq])

    return run


def make_exact(scene: Scene) -> Scene:
    """Returns the scene with its constraint solver made exact, so that its tolerance is no part of an error."""

    def change(model: mujoco.MjModel) -> None:
        model.opt.tolerance, model.opt.iterations = 0.0, 200

    return scene.changed(change)


def double_pendulum(_t: float, state: Array) -> list[float]:
    """Two point masses of 1 kg (own inertia 1e-4) on links of 0.3 m; state (q1, q2, v1, v2), the second relative.
    Lagrange's equations in the absolute angles a = q1 and b = q1 + q2."""
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


def make_servo(kp: float, kv: float) -> Derivative:
    """Returns a pendulum (1 kg, 0.5 m, own inertia 1e-4) under the torque -kp q - kv v; state (q, v)."""
    mass, length = 1.0, 0.5
    inertia = mass * length**2 + 1e-4

    def derivative(_t: float, state: Array) -> list[float]:
        q, v = state
        return [v, (-kp * q - kv * v - mass * GRAVITY * length * sin(q)) / inertia]

    return derivative


def spinning_body(_t: float, state: Array) -> list[float]:
    """A torque-free rigid body: Euler's equations in the body's frame and the quaternion's derivative q (0, w) / 2.
    State (position, quaternion w x y z, velocity, angular velocity in the body's frame), inertia (0.01, 0.02, 0.03)."""
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
    "servo": make_servo(*GAINS["servo"]),
    "stiff_servo": make_servo(*GAINS["stiff_servo"]),
    "spinning_body": spinning_body,
}
"""The equations of motion by hand, in MuJoCo's coordinates, where a user of SciPy would derive them."""


def pinocchio_rk4(name: str, scene: Scene) -> Run:
    """Classical RK4 in Python over Pinocchio's articulated-body algorithm; a servo is a torque written in Python."""
    pinocchio: Any = import_module("pinocchio")
    model = pinocchio.buildModelFromMJCF(str(find_scene(name)))
    model.gravity.linear = scene.model.opt.gravity
    data = model.createData()
    kp, kv = GAINS.get(name, (0.0, 0.0))
    order = [0, 1, 2, 4, 5, 6, 3] if model.nq == 7 else list(range(model.nq))  # its quaternions end with w
    back = np.argsort(order)
    start_q, start_v = scene.start.qpos[order].copy(), scene.start.qvel.copy()
    idle = np.zeros(model.nv)

    def acceleration(q: Array, v: Array) -> Array:
        torque = -kp * q - kv * v if kp else idle
        return np.array(pinocchio.aba(model, data, q, v, torque))

    def run(timestep_s: float, times: Array) -> Array:
        h, q, v = timestep_s, start_q, start_v
        samples = np.empty((len(times), model.nq))
        samples[0] = q
        for row in range(1, len(times)):
            for _ in range(round((times[row] - times[row - 1]) / h)):
                k1 = acceleration(q, v)
                v2 = v + h / 2 * k1
                k2 = acceleration(pinocchio.integrate(model, q, h / 2 * v), v2)
                v3 = v + h / 2 * k2
                k3 = acceleration(pinocchio.integrate(model, q, h / 2 * v2), v3)
                v4 = v + h * k3
                k4 = acceleration(pinocchio.integrate(model, q, h * v3), v4)
                q = pinocchio.integrate(model, q, h / 6 * (v + 2 * v2 + 2 * v3 + v4))
                v = v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            samples[row] = q
        return samples[:, back]

    return run


def drake_rk5(name: str, scene: Scene) -> Run:
    """Drake's error-controlled fifth-order Runge-Kutta on its MultibodyPlant, with dense output as in SciPy."""
    parsing, multibody, analysis = (
        import_module(f"pydrake.{module}") for module in ("multibody.parsing", "multibody.plant", "systems.analysis")
    )
    logging.getLogger("drake").setLevel(logging.ERROR)  # warnings list every MJCF element that it ignores
    plant: Any = multibody.MultibodyPlant(0.0)
    parsing.Parser(plant).AddModels(str(find_scene(name)))
    plant.mutable_gravity_field().set_gravity_vector(scene.model.opt.gravity)
    plant.Finalize()
    simulator = analysis.Simulator(plant)
    context = simulator.get_mutable_context()
    free = scene.model.nq == 7
    # Drake puts the quaternion before the position and the angular velocity before the linear one.
    order_q = [3, 4, 5, 6, 0, 1, 2] if free else list(range(scene.model.nq))
    order_v = [3, 4, 5, 0, 1, 2] if free else list(range(scene.model.nv))
    start = np.concatenate([scene.start.qpos[order_q], scene.start.qvel[order_v]])
    back = np.argsort(order_q)

    def run(tolerance: float, times: Array) -> Array:
        analysis.ResetIntegratorFromFlags(simulator, "runge_kutta5", 0.1)
        integrator = simulator.get_mutable_integrator()
        integrator.set_target_accuracy(tolerance)
        context.SetTime(0.0)
        plant.SetPositionsAndVelocities(context, start)
        simulator.Initialize()
        integrator.StartDenseIntegration()
        simulator.AdvanceTo(float(times[-1]))
        dense = integrator.StopDenseIntegration()
        return np.asarray(dense.vector_values(times)).T[:, : len(order_q)][:, back]

    return run
