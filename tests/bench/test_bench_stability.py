"""Classes of single points, edges three ways, and what collisions end in: held against the lesson's own figures."""

import pytest

from grader.bench.charts import CHARTS
from grader.bench.collisions import CASES, follow
from grader.bench.report.stability_analysis import as_grid, summarise
from grader.bench.scenes import load_scene
from grader.bench.settings_grid import INTEGRATORS
from grader.bench.stability import PARTS, Class, Column, as_rows, edge_task, full_task, map_task


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
    column = Column.of(CHARTS["stiffness"], 2000.0)
    assert column.classify(timestep_s, INTEGRATORS[integrator]) is kind


@pytest.mark.parametrize(
    ("integrator", "closed_ms", "simulated_ms"),
    [("Euler", 19.983, 20.116), ("implicitfast", 24.970, 25.194), ("RK4", 33.010, 33.677)],
)
def test_an_edge_three_ways(integrator: str, closed_ms: float, simulated_ms: float) -> None:
    edge = edge_task(CHARTS["stiffness"], integrator, 2000.0).measure()
    assert 1e3 * edge["closed_s"] == pytest.approx(closed_ms, abs=1e-3)
    assert edge["spectral_s"] == pytest.approx(edge["closed_s"], rel=1e-6)
    assert 1e3 * edge["simulated_s"] == pytest.approx(simulated_ms, abs=2e-3)


def test_discrete_has_no_edge() -> None:
    edge = edge_task(CHARTS["stiffness"], "discrete", 2000.0).measure()
    assert (edge["closed_s"], edge["spectral_s"], edge["simulated_s"]) == (None, None, None)


@pytest.mark.parametrize(("zeta", "limit"), [(0.01, 1.9801), (1.0, 2 * (2**0.5 - 1))])
def test_the_oscillators_closed_form_is_the_textbooks(zeta: float, limit: float) -> None:
    chart = CHARTS["oscillator"]
    assert chart.closed_form_s("Euler", zeta) * chart.timestep_scale == pytest.approx(limit, rel=1e-4)


def test_a_small_map_agrees_with_its_full_grid() -> None:
    chart, levels = CHARTS["stiffness"], 4
    record = map_task(chart, "Euler", levels).measure()
    refined = as_grid(record["classes"])
    for part in range(PARTS):
        full = as_grid(full_task(chart, "Euler", levels, part).measure()["classes"])
        assert (refined[::2, ::2][part::PARTS] == full).all()
    assert record["evaluations"] < 17 * 17
    assert as_rows(refined) == record["classes"]


BALL = [(1.0, 1e-3, "stopped"), (20.0, 1e-4, "pushed through"), (100.0, 1e-2, "tunnelled")]


@pytest.mark.parametrize(("speed", "timestep_s", "outcome"), BALL)
def test_what_becomes_of_the_ball(speed: float, timestep_s: float, outcome: str) -> None:
    case = CASES["ball"]
    start = case.start(load_scene(case.scene), speed)
    trace = follow(start, "ball", INTEGRATORS["Euler"], timestep_s, case.seconds(speed))
    assert case.outcome(trace) == outcome


@pytest.mark.parametrize(("depth", "outcome"), [(0.002, "settled"), (0.05, "launched")])
def test_what_becomes_of_the_box(depth: float, outcome: str) -> None:
    case = CASES["box"]
    start = case.start(load_scene(case.scene), depth)
    assert case.outcome(follow(start, "box", INTEGRATORS["Euler"], 1e-3, 1.0)) == outcome


def test_a_warning_sets_the_wheel_and_its_clock_back() -> None:
    case = CASES["wheel"]
    start = case.start(load_scene(case.scene), 50.0)
    trace = follow(start, "wheel", INTEGRATORS["Euler"], 0.02, case.seconds(50.0))
    assert trace.warning is not None
    assert trace.warned_at_s is not None
    assert trace.time_after_s == pytest.approx(0.02)
    assert trace.qpos_after == [0.0]
    assert case.outcome(trace) == "warned"
    calm = follow(start, "wheel", INTEGRATORS["discrete"], 0.02, case.seconds(50.0))
    assert case.outcome(calm) == "stopped"


def test_every_number_of_the_summary_comes_from_the_records() -> None:
    with pytest.raises(KeyError):
        summarise({})
