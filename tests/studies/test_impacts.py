"""Contact by distribution: starts that repeat, the same contact parameters in all runs, and a reference that two
solvers and tiny timesteps meet."""

import mujoco
import numpy as np
import pytest

from grader.numerics.accuracy.convergence import measure_position_distance
from grader.numerics.integrators import BY_NAME
from grader.numerics.rollout import simulate
from grader.studies.bench.errors.impacts import (
    BEST,
    OTHER,
    SPREAD,
    TIMESTEPS_S,
    draw_start,
    list_times,
    measure_error,
    solve_positions,
    summarise_errors,
)


@pytest.mark.parametrize("name", SPREAD)
def test_a_number_gives_the_same_start_and_another_number_another(name: str) -> None:
    one, again, other = (draw_start(name, number) for number in (3, 3, 4))
    assert one.start.qpos.tobytes() == again.start.qpos.tobytes()
    assert not np.array_equal(one.start.qpos, other.start.qpos)
    assert one.start.qvel.tobytes() == again.start.qvel.tobytes()


@pytest.mark.parametrize("name", SPREAD)
def test_all_runs_have_the_contact_parameters_of_the_reference(name: str) -> None:
    """At the largest timestep, MuJoCo without its safe time constants runs the same to the last bit."""

    def trust(model: mujoco.MjModel) -> None:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)

    scene, timestep_s = draw_start(name, 0), TIMESTEPS_S[name][0]
    for integrator in BY_NAME.values():
        plain, trusting = (
            simulate(one, steps=60, timestep_s=timestep_s, integrator=integrator.code).states.tobytes()
            for one in (scene, scene.changed(trust))
        )
        assert plain == trusting
    longer = [simulate(one, steps=60, timestep_s=0.016).states.tobytes() for one in (scene, scene.changed(trust))]
    assert longer[0] != longer[1]


def test_two_solvers_and_a_tiny_timestep_meet_at_the_reference() -> None:
    scene, times = draw_start("joint_limits", 1), list_times("joint_limits")
    truth = solve_positions(scene, times, BEST)
    assert measure_position_distance(scene, truth, solve_positions(scene, times, OTHER)) < 1e-6
    coarse, fine = (measure_error(scene, truth, "RK4", h, times) for h in (0.004, 0.0000625))
    assert coarse is not None
    assert fine is not None
    assert fine < min(coarse / 8, 1e-3)


def test_median_and_bound_are_those_of_a_known_distribution() -> None:
    """A uniform error of up to h has the median h / 2, the 95th percentile 0.95 h, and the order 1."""
    timesteps_s = (0.004, 0.002, 0.001)
    shares = (np.arange(1000) + 0.5) / 1000
    summary = summarise_errors([(h * shares).tolist() for h in timesteps_s], timesteps_s)
    assert summary["median"] == pytest.approx([h / 2 for h in timesteps_s], rel=2e-3)
    assert summary["high"] == pytest.approx([0.95 * h for h in timesteps_s], rel=2e-3)
    assert summary["orders"]["high"]["order"] == pytest.approx(1, abs=1e-9)


def test_a_run_that_warned_is_larger_than_any_error() -> None:
    errors: list[list[float | None]] = [[None] * 3 + [1e-3] * 17, [1e-3] * 20, [1e-3] * 20]
    summary = summarise_errors(errors, (0.004, 0.002, 0.001))
    assert summary["warned"] == 3
    assert summary["median"][0] == 1e-3
    assert summary["high"][0] is None
    assert "high" not in summary["orders"]
