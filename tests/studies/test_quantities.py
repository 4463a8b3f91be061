"""Errors of velocity, energy and violation against closed forms, and only where they mean something."""

import numpy as np
import pytest

from grader.studies.bench.errors.quantities import (
    SCENES,
    Runs,
    Truth,
    list_quantities,
    measure_errors,
    read_energy_and_violation,
    summarise_order,
)
from grader.studies.bench.physics.precision import TIMESTEPS_S
from grader.studies.bench.scenes import load_scene


def test_each_scene_has_the_quantities_that_mean_something() -> None:
    quantities = {name: list_quantities(load_scene(name))[2:] for name in SCENES}
    assert quantities == {
        "double_pendulum": ["energy"],
        "servo": [],
        "stiff_servo": [],
        "spinning_body": ["energy"],
        "eccentric_body": ["energy"],
        "joint_limits": ["violation"],
        "cube": ["violation"],
        "closed_loop": ["violation"],
    }


def test_the_energy_is_the_closed_form() -> None:
    """A torque-free body turns with the energy I w^2 / 2; its inertia is (0.01, 0.02, 0.03)."""
    state = np.array([0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1.0, 2.0, 3.0])
    energy, violation = read_energy_and_violation(load_scene("spinning_body"), state[None])
    assert energy[0] == pytest.approx((0.01 + 0.02 * 4 + 0.03 * 9) / 2)
    assert violation[0] == 0


def test_the_violation_is_how_far_a_limit_is_exceeded_and_a_box_sinks() -> None:
    states = np.array([[2.6, 0.0, 0.0, 0.0], [2.6, -1.3, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    _, beyond = read_energy_and_violation(load_scene("joint_limits"), states)
    assert beyond == pytest.approx([0.1, 0.3, 0.0])
    sunk = np.array([0, 0, 0.1 - 0.004, 1, 0, 0, 0, *[0.0] * 6])
    assert read_energy_and_violation(load_scene("cube"), sunk[None])[1] == pytest.approx([0.004])


def test_errors_are_the_differences_of_the_states() -> None:
    scene = load_scene("double_pendulum")
    one, other = np.zeros((2, 4)), np.zeros((2, 4))
    other[1] = [0.0, 0.0, 0.0, 0.2]
    errors = measure_errors(scene, one, other)
    # The lower bob of 1 kg moves with 0.3 m x 0.2 rad/s; its own inertia is 1e-4.
    assert errors == pytest.approx({"position": 0, "velocity": 0.2, "energy": (0.3**2 + 1e-4) * 0.2**2 / 2})


def test_a_smooth_scene_has_its_orders_and_bits_that_repeat() -> None:
    truth, run = Truth("servo").measure(True, {}), Runs("servo", "RK4").measure(True, {})
    assert max(truth["own_errors"].values()) < 1e-9
    assert run == Runs("servo", "RK4").measure(True, {})
    for errors in run["errors"].values():
        assert errors[-2] / errors[-1] == pytest.approx(16, rel=0.2)


def test_an_order_leaves_out_coarse_steps_and_noise() -> None:
    errors = [1e3, 1e2, *(h**2 for h in TIMESTEPS_S[2:6]), *[1e-12] * 4]
    fit = summarise_order(errors, own_error=1e-12)
    assert fit is not None
    assert fit["order"] == pytest.approx(2)
    assert summarise_order(errors[:4], 1e-12) is None
