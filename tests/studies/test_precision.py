"""The equations by hand, the peers, the references, and what is read off the points."""

import mujoco
import numpy as np
import pytest

from grader.numerics.accuracy.convergence import measure_position_distance
from grader.numerics.accuracy.reference import build_rate
from grader.studies.bench.physics.peers import (
    EQUATIONS,
    find_peers,
    make_by_hand,
    make_over_mj_forward,
    make_python_loop,
)
from grader.studies.bench.physics.precision import (
    HORIZON_S,
    SAMPLE_TIMES_S,
    SCENES,
    TIMESTEPS_S,
    YARDSTICK,
    Point,
    Setting,
    Stepping,
    Truth,
    compare_with_peer,
    find_cheapest,
    find_front,
    fit_asymptotic_order,
)
from grader.studies.bench.scenes import load_scene
from grader.studies.bench.timing import is_timer_known, restore_timer


@pytest.mark.parametrize("name", EQUATIONS)
def test_the_equations_by_hand_are_mujocos(name: str) -> None:
    scene = load_scene(name)
    generator = np.random.default_rng(1)
    with scene.borrow() as workspace:
        model, rate = workspace.model, build_rate(workspace)
        for _ in range(20):
            qpos, qvel = generator.normal(size=model.nq), 3 * generator.normal(size=model.nv)
            mujoco.mj_normalizeQuat(model, qpos)
            state = np.concatenate([qpos, qvel])
            assert EQUATIONS[name](0.0, state) == pytest.approx(rate(0.0, state), rel=1e-9, abs=1e-9)


def test_every_timestep_divides_the_sampling_interval() -> None:
    steps = np.array([HORIZON_S / h for h in TIMESTEPS_S]) / (len(SAMPLE_TIMES_S) - 1)
    assert len(TIMESTEPS_S) == 10
    assert steps == pytest.approx(np.round(steps), abs=1e-12)
    assert YARDSTICK[1] in TIMESTEPS_S
    assert len(SCENES) >= 7


@pytest.mark.parametrize("name", ["servo", "spinning_body"])
def test_two_peers_meet_at_the_reference(name: str) -> None:
    scene = load_scene(name)
    record = Truth(name).measure(False, {})
    truth = np.array(record["qpos"])
    assert record["own_error"] < 1e-10
    for run in (make_by_hand(name, scene, "LSODA"), make_over_mj_forward(scene, "DOP853")):
        assert measure_position_distance(scene, run(1e-10, SAMPLE_TIMES_S), truth) < 1e-7


@pytest.mark.slow
def test_the_reference_goes_through_impacts() -> None:
    scene = load_scene("joint_limits")
    record = Truth("joint_limits").measure(False, {})
    assert record["own_error"] < 1e-9
    finest = make_python_loop(scene, "RK4")(TIMESTEPS_S[-1], SAMPLE_TIMES_S)
    assert measure_position_distance(scene, finest, np.array(record["qpos"])) < 1e-4


def test_rotations_are_compared_as_rotations() -> None:
    scene = load_scene("spinning_body")
    turned = np.array([0, 0, 0, np.cos(0.05), np.sin(0.05), 0, 0])
    start = np.array([0, 0, 0, 1.0, 0, 0, 0])
    assert measure_position_distance(scene, turned[None], start[None]) == pytest.approx(0.1)
    flipped = turned * [1, 1, 1, -1, -1, -1, -1]
    assert measure_position_distance(scene, flipped[None], turned[None]) == pytest.approx(0, abs=1e-12)


def test_the_python_loop_is_what_our_stepping_does() -> None:
    scene = load_scene("double_pendulum")
    loop = make_python_loop(scene, "RK4")(0.002, SAMPLE_TIMES_S)
    work = Stepping(scene, "RK4", 0.002)
    assert work() == work.steps == 512
    assert np.array_equal(work.workspace.data.qpos, loop[-1])


def test_a_run_that_warned_has_no_error() -> None:
    record = Setting("stiff_servo", "Euler", 0.016).error(np.zeros((len(SAMPLE_TIMES_S), 1)), load_scene("stiff_servo"))
    assert record == {"warning": "mjWARN_BADQACC", "diverged_at_step": record["diverged_at_step"]}
    assert 0 < record["diverged_at_step"] < 64


def test_scipy_is_a_peer_everywhere() -> None:
    for name in SCENES:
        names = find_peers(name)
        assert {"SciPy LSODA, mj_forward", "SciPy DOP853, mj_forward", "Python loop, RK4"} <= set(names)
        assert ("SciPy DOP853, by hand" in names) == (name in EQUATIONS)


def test_the_wheels_timer_comes_and_goes() -> None:
    scene = load_scene("servo")
    with scene.borrow() as workspace:
        timer = workspace.data.timer[mujoco.mjtTimer.mjTIMER_STEP]
        mujoco.mj_step(workspace.model, workspace.data)
        assert timer.duration == 0
        with restore_timer():
            mujoco.mj_step(workspace.model, workspace.data)
        assert (timer.duration > 0) is is_timer_known()


def point(method: str, setting: float, error: float | None, cost: float) -> Point:
    return Point(method, setting, error, cost, (0.9 * cost, cost, 1.1 * cost))


POINTS = [
    point("Euler", 0.016, 1e-1, 1.0),
    point("Euler", 0.008, 5e-2, 2.0),
    point("RK4", 0.016, 1e-3, 4.0),
    point("RK4", 0.008, 6e-5, 8.0),
    point("discrete", 0.016, 2e-1, 3.0),
    point("implicit", 0.016, None, 0.5),
]


def test_the_front_holds_what_nothing_beats() -> None:
    assert [p.cost for p in find_front(POINTS)] == [1.0, 2.0, 4.0, 8.0]


@pytest.mark.parametrize(("tolerance", "cost"), [(1e-1, 1.0), (6e-2, 2.0), (1e-2, 4.0), (1e-4, 8.0)])
def test_the_cheapest_setting_for_a_tolerance(tolerance: float, cost: float) -> None:
    best = find_cheapest(POINTS, tolerance)
    assert best is not None
    assert best.cost == cost
    assert find_cheapest(POINTS, 1e-9) is None


def test_an_order_is_fitted_where_the_error_falls() -> None:
    errors = [40 * h**4 for h in TIMESTEPS_S]
    points = [point("RK4", h, max(e, 1e-14), 1 / h) for h, e in zip(TIMESTEPS_S, errors, strict=True)]
    fit = fit_asymptotic_order(points, own_error=1e-15)
    assert fit is not None
    assert fit["order"] == pytest.approx(4, abs=1e-6)
    assert fit["points"] < 10
    assert fit_asymptotic_order(points[:2], 1e-15) is None


def test_a_peer_is_compared_at_the_same_tolerance() -> None:
    compared = compare_with_peer(find_cheapest(POINTS, 1e-3), point("SciPy", 1e-6, 1e-7, 12.0))
    assert compared is not None
    assert compared["ratio"] == 3.0
    assert compared["interval"] == pytest.approx([3 * 0.9 / 1.1, 3 * 1.1 / 0.9])
    assert compare_with_peer(None, None) is None
