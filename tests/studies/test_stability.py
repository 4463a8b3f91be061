"""Classes of single points, edges three ways, and what collisions end in: held against the lesson's own figures."""

import pytest

from grader.studies.bench.physics.collisions import CASES
from grader.studies.bench.physics.grid import to_grid, to_rows
from grader.studies.bench.physics.stability import CHARTS, LEVELS, Class, Edge, Full, Map, summarise
from grader.studies.bench.scenes import load_scene


@pytest.mark.parametrize(
    ("integrator", "timestep_s", "kind"),
    [
        ("Euler", 0.0199, Class.STABLE),
        ("Euler", 0.02005, Class.SLOW),
        ("Euler", 0.021, Class.UNSTABLE),
        ("implicitfast", 0.0249, Class.STABLE),
        ("implicitfast", 0.0251, Class.SLOW),
        ("implicitfast", 0.026, Class.UNSTABLE),
        ("RK4", 0.0329, Class.STABLE),
        ("RK4", 0.0576, Class.WINDOW),
        ("RK4", 0.060, Class.UNSTABLE),
        ("discrete", 0.1, Class.STABLE),
    ],
)
def test_points_of_the_map_are_what_the_lessons_servo_does(integrator: str, timestep_s: float, kind: Class) -> None:
    assert Map("stiffness", integrator).classify(timestep_s, 2000.0) is kind


@pytest.mark.parametrize(
    ("integrator", "closed_ms", "simulated_ms"),
    [("Euler", 19.983, 20.116), ("implicitfast", 24.970, 25.194), ("RK4", 33.010, 33.677)],
)
def test_an_edge_three_ways(integrator: str, closed_ms: float, simulated_ms: float) -> None:
    edge = Edge("stiffness", integrator, 2000.0).measure(False, {})
    assert 1e3 * edge["closed_s"] == pytest.approx(closed_ms, abs=1e-3)
    assert edge["spectral_s"] == pytest.approx(edge["closed_s"], rel=1e-6)
    assert 1e3 * edge["simulated_s"] == pytest.approx(simulated_ms, abs=2e-3)


def test_discrete_has_no_edge() -> None:
    edge = Edge("stiffness", "discrete", 2000.0).measure(False, {})
    assert (edge["closed_s"], edge["spectral_s"], edge["simulated_s"]) == (None, None, None)


@pytest.mark.parametrize(("zeta", "limit"), [(0.01, 1.9801), (1.0, 2 * (2**0.5 - 1))])
def test_the_oscillators_closed_form_is_the_textbooks(zeta: float, limit: float) -> None:
    chart = CHARTS["oscillator"]
    assert chart.closed_form_s("Euler", zeta) * chart.timestep_scale == pytest.approx(limit, rel=1e-4)


def test_a_small_map_agrees_with_its_full_grid() -> None:
    record = Map("stiffness", "Euler").measure(True, {})
    refined = to_grid(record["classes"])
    full = to_grid(Full("stiffness", "Euler").measure(True, {})["classes"])
    assert (refined[::2, ::2] == full).all()
    assert to_grid(record["evaluated"]).mean() < 0.5
    assert len(refined) == 2 ** LEVELS[True] + 1
    assert to_rows(refined) == record["classes"]


BALL = [(1.0, 1e-3, "stopped"), (20.0, 1e-4, "pushed through"), (100.0, 1e-2, "tunnelled")]


@pytest.mark.parametrize(("speed", "timestep_s", "outcome"), BALL)
def test_what_becomes_of_the_ball(speed: float, timestep_s: float, outcome: str) -> None:
    case = CASES["ball"]
    start = case.start(load_scene(case.scene), speed)
    trace = case.follow(start, speed, "Euler", timestep_s)
    assert case.outcome(trace) == outcome


@pytest.mark.parametrize(("depth", "outcome"), [(0.002, "settled"), (0.05, "launched")])
def test_what_becomes_of_the_box(depth: float, outcome: str) -> None:
    case = CASES["box"]
    start = case.start(load_scene(case.scene), depth)
    assert case.outcome(case.follow(start, depth, "Euler", 1e-3)) == outcome


def test_a_warning_sets_the_wheel_and_its_clock_back() -> None:
    case = CASES["wheel"]
    start = case.start(load_scene(case.scene), 50.0)
    trace = case.follow(start, 50.0, "Euler", 0.02)
    assert trace.reset is not None
    assert trace.reset["warned_at_s"] > 0.02
    assert trace.reset["time_after_s"] == pytest.approx(0.02)
    assert trace.reset["qpos_after"] == [0.0]
    assert case.outcome(trace) == "warned"
    calm = case.follow(start, 50.0, "discrete", 0.02)
    assert case.outcome(calm) == "stopped"


def test_every_number_of_the_summary_comes_from_the_records() -> None:
    with pytest.raises(KeyError):
        summarise({})
