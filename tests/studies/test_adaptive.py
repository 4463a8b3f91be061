"""Adaptive solvers: every evaluation is counted, solvers agree, and an interval covers as often as it says."""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from grader.numerics.accuracy.convergence import measure_position_distance
from grader.numerics.accuracy.reference import Method
from grader.studies.bench.physics import adaptive
from grader.studies.bench.physics.adaptive import Adaptive, Fixed, Truth
from grader.studies.bench.scenes import load_scene
from grader.studies.bench.study import Records
from grader.studies.bench.timing import compute_median_interval


def counting(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    calls, forward = [0], mujoco.mj_forward

    def counted(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        calls[0] += 1
        forward(model, data)

    monkeypatch.setattr("grader.numerics.accuracy.reference.build_rate.__defaults__", (counted,))
    return lambda: calls[0]


@pytest.mark.parametrize("method", adaptive.METHODS)
@pytest.mark.slow
def test_every_evaluation_is_counted_those_of_jacobians_too(method: Method, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = counting(monkeypatch)
    work = Adaptive("stiff_servo", method, 1e-3)
    for _ in range(2):
        before = calls()
        work()
        assert work.evaluations == calls() - before > 50


def test_solvers_of_different_families_agree_and_a_tighter_tolerance_is_closer() -> None:
    scene, best = load_scene("double_pendulum"), Adaptive("double_pendulum", "DOP853", 1e-11)()
    coarse, fine = (
        [
            measure_position_distance(scene, best, Adaptive("double_pendulum", method, tolerance)())
            for method in adaptive.METHODS
        ]
        for tolerance in (1e-3, 1e-7)
    )
    assert max(fine) < 1e-5 < min(coarse) < max(coarse) < 0.1


def test_a_setting_that_warns_has_no_error_and_a_calm_one_counts_its_evaluations() -> None:
    truth: Records = {Truth("stiff_servo"): {"qpos": Adaptive("stiff_servo", "DOP853", 1e-9)().tolist()}}
    assert Fixed("stiff_servo", "Euler", 0.016).measure(True, truth)["error"] is None
    calm = Fixed("stiff_servo", "RK4", 0.002).measure(True, truth)
    assert calm["evaluations"] == 4 * round(1.024 / 0.002)
    assert 1e-4 < calm["error"] < 1e-2


def test_the_interval_of_a_median_covers_it_as_often_as_it_says() -> None:
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(100):
        low, high = compute_median_interval(rng.exponential(1.0, 25).tolist())
        covered += low <= np.log(2) <= high
    assert 0.90 < covered / 100 < 0.99


@pytest.mark.slow
def test_the_interval_of_a_quotient_covers_it_as_often_as_it_says() -> None:
    rng = np.random.default_rng(2)
    covered = 0
    for _ in range(100):
        low, high = compute_median_interval(rng.normal(6, 1, 25).tolist(), rng.normal(3, 0.3, 40).tolist())
        covered += low <= 2 <= high
    assert 0.90 < covered / 100 <= 0.99
