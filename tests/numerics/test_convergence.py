"""Orders of the integrators on their asymptotic range."""

from math import inf

import numpy as np
import pytest

from grader.numerics.accuracy.convergence import OrderFit, fit_order, measure_distance
from grader.numerics.accuracy.drift import measure_drift
from grader.numerics.accuracy.reference import list_sample_times, solve_dop853
from grader.numerics.accuracy.runge_kutta import step_lie_rk4, step_mujoco_rk4
from grader.numerics.integrators import EULER
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.shares import bound_share
from grader.numerics.stepping import Stepper
from grader.numerics.version import RK4_ORDER_ON_ROTATIONS
from numerics.measuring import errors
from numerics.models import ALL, LESSON

TIMES = list_sample_times(1.0, 0.02)
DOUBLE = Scene.from_xml(LESSON["double_pendulum"], key="release")
RK4 = 1


def order_of(scene: Scene, timesteps_s: list[float], integrator: int, stepper: Stepper | None = None) -> OrderFit:
    differences = errors(scene, solve_dop853(scene, TIMES), timesteps_s, integrator=integrator, stepper=stepper)
    return fit_order(timesteps_s, [error.qpos for error in differences])


def test_an_order_comes_with_its_interval() -> None:
    order = order_of(DOUBLE, [0.0008, 0.0004, 0.0002, 0.00016], RK4)
    assert order.low < order.order < order.high < order.low + 0.2


@pytest.mark.parametrize("name", ["free_body", "sprung_body", "ball"])
@pytest.mark.slow
def test_on_rotations_mujocos_rk4_is_of_the_order_of_its_version_and_the_lie_group_one_of_fourth(name: str) -> None:
    scene, timesteps_s = Scene.from_xml(ALL[name], key="spin"), [0.005, 0.004, 0.002, 0.001]
    assert order_of(scene, timesteps_s, RK4).order == pytest.approx(RK4_ORDER_ON_ROTATIONS, abs=0.05)
    assert order_of(scene, timesteps_s, RK4, step_mujoco_rk4).order == pytest.approx(RK4_ORDER_ON_ROTATIONS, abs=0.05)
    assert order_of(scene, timesteps_s, RK4, step_lie_rk4).order == pytest.approx(4.0, abs=0.1)


def test_without_rotations_the_two_rk4_agree_to_rounding() -> None:
    one, other = (
        simulate(DOUBLE, seconds=1, timestep_s=0.002, integrator=RK4, stepper=stepper)
        for stepper in (step_mujoco_rk4, step_lie_rk4)
    )
    assert measure_distance(DOUBLE, one, other).qpos < 1e-13


def test_the_interval_of_an_order_covers_a_known_slope() -> None:
    rng = np.random.default_rng(3)
    timesteps = [0.008, 0.004, 0.002, 0.001, 0.0005]
    covered = 0
    for _ in range(400):
        noisy = [h**2 * float(np.exp(0.1 * rng.standard_normal())) for h in timesteps]
        order = fit_order(timesteps, noisy)
        covered += order.low <= 2.0 <= order.high
    assert 0.92 < covered / 400 < 0.98


def test_an_order_needs_three_positive_errors() -> None:
    for timesteps, values in (([0.1, 0.2], [1.0, 2.0]), ([0.1, 0.2, 0.4], [0.0, 1.0, 2.0]), ([1, 2, 4], [1, inf, 2])):
        with pytest.raises(ValueError, match="three or more"):
            fit_order(timesteps, values)


def test_an_order_needs_timesteps_that_differ() -> None:
    for timesteps in ([0.1, 0.1, 0.1], [0.0, 0.1, 0.2], [-0.1, 0.1, 0.2], [0.1, 0.2, inf]):
        with pytest.raises(ValueError, match="timesteps that differ"):
            fit_order(timesteps, [1.0, 2.0, 4.0])


@pytest.mark.parametrize(("successes", "runs"), [(0, 0), (1, 0), (-1, 3), (4, 3)])
def test_no_share_without_runs_or_with_more_successes(successes: int, runs: int) -> None:
    with pytest.raises(ValueError, match="have no share"):
        bound_share(successes, runs)


@pytest.mark.parametrize(("steps", "samples"), [(0, 5), (-1, 5), (5, 0)])
def test_a_drift_needs_steps_and_samples(steps: int, samples: int) -> None:
    with pytest.raises(ValueError, match="steps and samples"):
        measure_drift(DOUBLE, EULER, 0.01, steps, samples)


def test_a_run_that_ended_early_is_infinitely_far() -> None:
    whole = simulate(DOUBLE, seconds=0.1)
    assert measure_distance(DOUBLE, whole, simulate(DOUBLE, seconds=0.05)).qpos == inf
    with pytest.raises(ValueError, match="different times"):
        measure_distance(DOUBLE, whole, simulate(DOUBLE, steps=50, timestep_s=0.001))
