"""Pinocchio and Drake, where the optional extra `peers` is installed; both read the same MJCF as MuJoCo."""

import contextlib
import logging
from importlib import import_module
from typing import Any

import numpy as np

from grader.bench.by_hand import Array
from grader.bench.peers import TOLERANCES, Peer, Run
from grader.bench.scenes import scene_path
from grader.bench.settings_grid import TIMESTEPS_S
from grader.numerics.scene import Scene

PINOCCHIO_SCENES = ("double_pendulum", "servo", "stiff_servo", "spinning_body")
DRAKE_SCENES = ("double_pendulum", "spinning_body")
GAINS = {"servo": (100.0, 5.0), "stiff_servo": (20000.0, 5.0)}


def optional_peers(name: str, scene: Scene) -> list[Peer]:
    """The peers among the two that are installed and can run the scene."""
    found = []
    with contextlib.suppress(ImportError):
        if name in PINOCCHIO_SCENES:
            found.append(Peer("Pinocchio ABA + RK4", pinocchio_rk4(name, scene), TIMESTEPS_S))
    with contextlib.suppress(ImportError):
        if name in DRAKE_SCENES:
            found.append(Peer("Drake RK5", drake_rk5(name, scene), TOLERANCES))
    return found


def pinocchio_rk4(name: str, scene: Scene) -> Run:
    """Classical RK4 in Python over Pinocchio's articulated-body algorithm; a servo is a torque written in Python."""
    pinocchio: Any = import_module("pinocchio")
    model = pinocchio.buildModelFromMJCF(str(scene_path(name)))
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
    logging.getLogger("drake").setLevel(logging.ERROR)  # it tells at length which MJCF elements it ignores
    plant: Any = multibody.MultibodyPlant(0.0)
    parsing.Parser(plant).AddModels(str(scene_path(name)))
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
