"""Energy drift: relative to what the motion has, ended by a warning, and small where the scene is easy."""

import pytest

from grader.studies.bench.physics import energy
from grader.studies.bench.scenes import load_scene


def test_the_scale_is_the_energy_above_rest() -> None:
    """Rest of the pendulum hangs both masses straight down; the torque-free body has its kinetic energy alone."""
    pendulum = load_scene("double_pendulum").at(qpos=[3.141592653589793, 0.0], qvel=[0.0, 0.0])
    assert energy.compute_depth(pendulum) == pytest.approx(9.81 * (2 * 0.3 + 2 * 0.6))
    body = load_scene("spinning_body").at(qvel=[0, 0, 0, 1, 2, 3])
    assert energy.compute_depth(body) == pytest.approx((0.01 * 1 + 0.02 * 4 + 0.03 * 9) / 2)


def test_rk4_drifts_less_at_a_smaller_step_and_euler_far_more() -> None:
    runs = [energy.Long("double_pendulum", *setting).measure(True, {}) for setting in (("RK4", 0.004), ("RK4", 0.002))]
    coarse, fine = (max(energy.find_largest_by_minute(run)) for run in runs)
    assert 8 * fine < coarse < 1e-2
    assert (
        max(energy.find_largest_by_minute(energy.Long("double_pendulum", "Euler", 0.002).measure(True, {})))
        > 100 * coarse
    )
    assert len(runs[0]["errors"]) == 31
    assert runs[0]["warning"] is None


def test_a_warning_ends_the_run() -> None:
    run = energy.Long("double_pendulum", "implicit", 0.004).measure(True, {})
    kind, at_s = run["warning"]
    assert kind == "BADQACC"
    assert run["time_s"][-1] <= at_s < 30
    assert min(run["errors"]) > -0.9
