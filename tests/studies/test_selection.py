"""The choice of integrator and timestep, by measured error."""

from functools import cache, partial

import mujoco
import numpy as np
import pytest

from grader.numerics.accuracy.convergence import measure_distance
from grader.numerics.accuracy.reference import list_sample_times, solve_dop853
from grader.numerics.integrators import DISCRETE, EULER, IMPLICITFAST, RK4, find_refusal
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.studies.advise.meter import SAMPLE_S, Meter, Quantity, choose_interval
from grader.studies.advise.selection import (
    CONFIRMATIONS,
    PREFERENCE,
    TIMESTEPS_S,
    Candidate,
    QuantityStill,
    Selection,
    describe_error,
    describe_setting,
    find_front,
    select,
)
from numerics.models import ALL, DELAY, LESSON, RUNAWAY, hinge

pytestmark = pytest.mark.slow

DOUBLE = Scene.from_xml(LESSON["double_pendulum"], key="release")


@cache
def fine_choice() -> Selection:
    """What several tests look at, made once."""
    return select(DOUBLE, tolerance=1e-5, seconds=1.0)


def test_accuracy_on_an_energy_conserving_scene_is_cheapest_with_rk4() -> None:
    chosen = fine_choice()
    assert chosen.best is not None
    assert chosen.best.integrator == RK4
    assert chosen.margin >= 1
    assert chosen.best.error * chosen.margin == pytest.approx(1e-5)
    assert "RK4" in chosen.reason


def test_the_choice_is_the_cheapest_that_passes() -> None:
    chosen = fine_choice()
    assert chosen.best is not None
    cheaper = [c for c in chosen.candidates if c.cost < chosen.best.cost]
    assert cheaper
    assert all(c.error > 1e-5 for c in cheaper)


def test_a_loose_tolerance_takes_a_single_step_method() -> None:
    chosen = select(Scene.from_xml(LESSON["pendulum_servo"]).at(qpos=[0.1]), tolerance=0.02, seconds=1.0)
    assert chosen.best is not None
    assert chosen.best.integrator == IMPLICITFAST


def test_an_integrator_that_mujoco_refuses_is_left_out() -> None:
    """`discrete` knows no sleep without islands."""
    scene = Scene.from_xml(hinge(rest="<option><flag sleep='enable' island='disable'/></option>")).at(qvel=[1.0])
    assert find_refusal(scene.model, DISCRETE) is not None
    chosen = select(scene, tolerance=1e-3, seconds=0.04, timesteps_s=(0.01, 0.005, 0.002, 0.001))
    assert chosen.best is not None
    assert DISCRETE not in {candidate.integrator for candidate in chosen.candidates}


def test_a_quantity_of_ones_own_is_what_counts() -> None:
    def height(_model: mujoco.MjModel, data: mujoco.MjData) -> float:
        return float(data.site("tip").xpos[2])

    chosen = select(DOUBLE, tolerance=1e-5, seconds=0.5, quantity=height)
    by_angle = select(DOUBLE, tolerance=1e-5, seconds=0.5)
    assert chosen.best is not None and by_angle.best is not None
    assert chosen.best.error <= 1e-5
    assert {c.error for c in chosen.candidates} != {c.error for c in by_angle.candidates}


def test_it_says_so_when_nothing_is_good_enough() -> None:
    chosen = select(DOUBLE, tolerance=1e-7, seconds=1.0, integrators=(EULER,))
    assert chosen.best is None
    assert "none of the candidates" in chosen.reason


def test_it_says_so_when_it_cannot_tell() -> None:
    chaotic = select(DOUBLE, tolerance=1e-6, seconds=12.0, integrators=(RK4,), timesteps_s=(0.002,))
    assert chaotic.best is None
    assert chaotic.until_s is not None
    assert 2 < chaotic.until_s < 12
    assert chaotic.reason.startswith(f"cannot tell beyond {chaotic.until_s:g} s: ")
    assert f"until {chaotic.until_s:g} s none of the candidates meets" in chaotic.reason
    touching = select(Scene.from_xml(ALL["cube"]), tolerance=1e-9, seconds=0.5, timesteps_s=(0.002, 0.001))
    assert touching.reason.startswith("cannot tell beyond 0.16 s")
    # Source: the cube's lowest corner falls 0.142 m, in 0.170 s.
    assert touching.until_s == pytest.approx(0.16)


def test_a_pass_by_accident_does_not_count() -> None:
    """The next smaller timesteps must pass too."""
    chosen = fine_choice()
    assert chosen.best is not None
    finer = sorted((h for h in TIMESTEPS_S if h < chosen.best.timestep_s), reverse=True)[:CONFIRMATIONS]
    of_same = {c.timestep_s: c.error for c in chosen.candidates if c.integrator == chosen.best.integrator}
    assert len(finer) == CONFIRMATIONS
    assert all(of_same[h] <= 1e-5 for h in finer)


STICK = """<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="5 5 .1" friction=".5"/>
  <body pos="0 0 .0995"><joint type="slide" axis="1 0 0" name="x"/><joint type="slide" axis="0 0 1"/>
  <geom type="box" size=".1 .1 .1" mass="1" friction=".5"/></body></worldbody>
  <actuator><position joint="x" kp="100" kv="1"/></actuator></mujoco>"""
"""A box that sticks and slips: RK4 is near the truth at 0.1 ms alone."""


@cache
def accident() -> Selection:
    """RK4 on a box that sticks and slips, within 1e-3."""
    return select(
        Scene.from_xml(STICK).at(ctrl=[1]), tolerance=1e-3, seconds=0.9, integrators=(RK4,),
        quantity=lambda _model, data: float(data.qpos[0]), timesteps_s=(0.0002, 0.0001),
    )  # fmt: skip


def test_the_smallest_timestep_does_not_pass_by_accident() -> None:
    chosen = accident()
    errors = {c.timestep_s: c.error for c in chosen.candidates if c.integrator == RK4}
    assert errors[0.0001] <= 1e-3 < errors[0.00005]
    assert chosen.best is None


def test_none_is_explained_by_the_smaller_timestep_that_does_not_confirm() -> None:
    words = "none of the candidates meets 0.001 for certain; the best, RK4 at 0.1 ms, has an error of 0.0004, but by "
    assert accident().reason == words + "accident, as RK4 at 0.05 ms has one of 0.01"


def test_none_is_explained_by_the_uncertainty_of_the_reference_where_that_decides() -> None:
    asked = partial(select, DOUBLE, seconds=0.5, integrators=(RK4,), timesteps_s=(0.002, 0.001))
    seen = asked(tolerance=1e-9)
    least = min(c.error for c in seen.candidates)
    tolerance = least + seen.reference_error / 2
    chosen = asked(tolerance=tolerance)
    error, doubt = min(c.error for c in chosen.candidates), chosen.reference_error
    assert error <= tolerance < error + doubt
    assert f"an error of {error:.2g}, with the uncertainty of the reference, {doubt:.2g}, added " in chosen.reason
    assert float(chosen.reason.split("added ")[1]) > tolerance


def test_the_smallest_timestep_is_chosen_where_half_of_it_confirms() -> None:
    chosen = select(DOUBLE, tolerance=1e-5, seconds=0.5, integrators=(RK4,), timesteps_s=(0.002,))
    assert chosen.best is not None
    assert chosen.best.setting == (RK4, 0.002)
    (half,) = (c for c in chosen.candidates if c.confirms)
    assert half.setting == (RK4, 0.001)
    assert half.error < chosen.best.error
    assert half not in chosen.front


def test_no_cheaper_setting_passes_that_was_left_unmeasured() -> None:
    """The search leaves out settings; measured one by one, none of these is cheaper and passes."""
    chosen = select(DOUBLE, tolerance=1e-4, seconds=0.4)
    assert chosen.best is not None
    left = {(i, h) for i in PREFERENCE for h in TIMESTEPS_S} - {c.setting for c in chosen.candidates}
    cheaper = [(i, h) for i, h in left if i.evaluations / h < chosen.best.cost]
    assert cheaper
    times = np.asarray(list_sample_times(0.4, SAMPLE_S))
    truth = solve_dop853(DOUBLE, times)
    for integrator, h in cheaper:
        run = simulate(DOUBLE, seconds=0.4, timestep_s=h, integrator=integrator.code, at_s=times)
        assert measure_distance(DOUBLE, run, truth).qpos > 1e-4


def test_the_front_holds_what_nothing_beats_in_cost_and_error() -> None:
    chosen = fine_choice()
    assert chosen.front
    for candidate in chosen.candidates:
        as_good = [c for c in chosen.candidates if c.cost <= candidate.cost and c.error <= candidate.error]
        better = [c for c in as_good if (c.cost, c.error) != (candidate.cost, candidate.error)]
        assert not (better and candidate in chosen.front)
        assert better or {(c.cost, c.error) for c in chosen.front} >= {(candidate.cost, candidate.error)}


@pytest.mark.parametrize(
    ("error", "doubt", "written"),
    [
        (4.2e-5, 4.11e-5, "an error of 4.2e-05"),
        (4.01e-5, 4.2e-5, "an error below 8.3e-05"),
        (0.0, 2e-3, "an error below 0.002"),
        (0.0, 0.0, "an error of 0"),
    ],
)
def test_an_error_below_the_uncertainty_of_the_reference_is_a_bound(error: float, doubt: float, written: str) -> None:
    assert describe_error(error, doubt) == written


def test_noise_below_the_uncertainty_of_the_reference_is_not_on_the_front() -> None:
    sizes = {0.002: 1e-2, 0.001: 4.4e-5, 0.0005: 4.3e-5, 0.0002: 0.0}
    candidates = [Candidate(RK4, h, error, 4 / h) for h, error in sizes.items()]
    assert [c.timestep_s for c in find_front(candidates, 4.5e-5)] == [0.002, 0.001]
    assert [c.timestep_s for c in find_front(candidates, 0.0)] == list(sizes)


@pytest.mark.parametrize(
    ("seconds", "interval_s"), [(2.0, 0.02), (1.0, 0.02), (0.9, 0.01), (0.5, 0.01), (0.2, 0.002), (0.02, 0.001)]
)
def test_short_runs_are_compared_more_often(seconds: float, interval_s: float) -> None:
    assert choose_interval(seconds) == interval_s
    meter = Meter(DOUBLE, seconds, None, interval_s)
    for timestep_s in TIMESTEPS_S:
        times = meter.times_of(timestep_s)
        assert len(times)
        assert np.isclose(times[:, None], meter.grid_s, rtol=0, atol=1e-9).any(axis=1).all()


def test_an_error_that_decays_within_20_ms_is_seen() -> None:
    """A servo of 1732 rad/s: at multiples of 20 ms, implicitfast at 0.5 ms would seem to be within 0.01."""
    servo = "<actuator><position joint='hinge' kp='1e6' kv='100'/></actuator>"
    stiff = Scene.from_xml(hinge(rest=servo)).at(qpos=[0.5])
    chosen = select(stiff, tolerance=1e-2, seconds=0.2)
    assert chosen.interval_s == 0.002
    assert chosen.best is not None
    times = list_sample_times(0.2, 5e-4)
    run = simulate(
        stiff, seconds=0.2, timestep_s=chosen.best.timestep_s, integrator=chosen.best.integrator.code, at_s=times
    )
    error = measure_distance(stiff, run, solve_dop853(stiff, times)).qpos
    assert error <= 1e-2


@pytest.mark.parametrize("timestep_s", [0.003, 1 / 120, 0.0007])
def test_the_models_own_setting_is_measured_at_its_own_steps(timestep_s: float) -> None:
    own = DOUBLE.changed(lambda model: setattr(model.opt, "timestep", timestep_s))
    chosen = select(own, tolerance=1e-3, seconds=0.4)
    assert chosen.own is not None
    steps = np.unique(np.rint(np.asarray(list_sample_times(0.4, choose_interval(0.4))) / timestep_s))
    truth = solve_dop853(DOUBLE, steps * timestep_s)
    run = simulate(DOUBLE, steps=int(steps[-1]), timestep_s=timestep_s, at_s=steps * timestep_s)
    assert chosen.own.error == pytest.approx(measure_distance(DOUBLE, run, truth).qpos, rel=1e-6)


def test_a_stepped_reference_is_read_between_its_steps() -> None:
    """A sphere that rolls has a known motion; a timestep that is no multiple of the reference's sees no other error."""
    cube = Scene.from_xml(ALL["cube"]).changed(lambda model: setattr(model.opt, "timestep", 0.0033))
    close = Scene.from_xml(ALL["cube"]).changed(lambda model: setattr(model.opt, "timestep", 0.0032))
    one, other = (select(scene, tolerance=1e-2, seconds=0.3).own for scene in (cube, close))
    assert one is not None and other is not None
    assert one.error == pytest.approx(other.error, rel=0.5)


def test_what_hardly_moves_is_refused() -> None:
    with pytest.raises(QuantityStill, match="never move"):
        select(Scene.from_xml(LESSON["pendulum_servo"]), tolerance=1e-3, seconds=0.2)
    with pytest.raises(QuantityStill, match="move by"):
        select(Scene.from_xml(LESSON["pendulum_servo"]).at(qpos=[1e-5]), tolerance=1e-3, seconds=0.2)


def test_a_budget_leaves_the_best_so_far_or_says_that_it_cannot_tell() -> None:
    spent = select(DOUBLE, tolerance=1e-6, seconds=1.0, budget_s=0.0)
    assert spent.best is None
    assert "budget" in spent.reason
    cube = select(Scene.from_xml(ALL["cube"]), tolerance=1e-5, seconds=1.0, budget_s=0.3)
    assert "budget" in cube.reason or "uncertain" in cube.reason


def test_what_tolerance_could_be_told_is_said() -> None:
    cube = Scene.from_xml(ALL["cube"])
    refused = select(cube, tolerance=1e-9, seconds=0.3)
    assert refused.told is not None
    assert f"a tolerance of {refused.told:.1g} or more could be told" in refused.reason
    assert not select(cube, tolerance=1.1 * refused.told, seconds=0.3).reason.startswith("cannot tell")


def test_the_same_choice_every_time() -> None:
    assert select(DOUBLE, tolerance=1e-4, seconds=0.2) == select(DOUBLE, tolerance=1e-4, seconds=0.2)


@pytest.mark.parametrize(
    ("tolerance", "seconds"), [(0, 1), (-1, 1), (float("nan"), 1), (1e-3, 0), (1e-3, float("inf"))]
)
def test_meaningless_questions_are_refused(tolerance: float, seconds: float) -> None:
    with pytest.raises(ValueError, match="tolerance"):
        select(DOUBLE, tolerance=tolerance, seconds=seconds)


def test_names_are_spelt_as_in_the_lesson() -> None:
    chosen = select(DOUBLE, tolerance=1e-4, seconds=0.1)
    spoken = {describe_setting(c).split(" at ")[0] for c in chosen.candidates}
    assert spoken == {"Euler", "RK4", "implicit", "implicitfast", "discrete"}


@pytest.mark.parametrize("quantity", [None, lambda _model, data: float(data.qpos[0])])
def test_timesteps_must_divide_the_samples(quantity: Quantity | None) -> None:
    with pytest.raises(ValueError, match="divide"):
        select(DOUBLE, tolerance=1e-2, seconds=0.2, quantity=quantity, timesteps_s=(0.003,))


def test_a_run_of_too_many_steps_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match="may last 250 s"):
        select(DOUBLE, tolerance=1e-2, seconds=1e9)


@pytest.mark.parametrize(("scene", "why"), [(RUNAWAY, "without bound"), (DELAY, "delay")])
def test_what_has_no_reference_cannot_be_told(scene: str, why: str) -> None:
    moving = Scene.from_xml(scene).at(qpos=[0.1], qvel=[1e8 if scene is RUNAWAY else 0])
    chosen = select(moving, tolerance=1e-2, seconds=0.2)
    assert (chosen.best, chosen.candidates) == (None, ())
    assert chosen.reason.startswith("cannot tell")
    assert why in chosen.reason


def test_limited_activations_are_held_against_fine_steps() -> None:
    """DOP853 would go on beyond the limit, which the activation reaches after 0.1 s."""
    integrator = "<intvelocity joint='hinge' kp='3' actrange='-.1 .1'/>"
    limited = Scene.from_xml(hinge("damping='.5'", rest=f"<actuator>{integrator}</actuator>")).at(ctrl=[1])
    chosen = select(limited, tolerance=1e-2, seconds=0.5, timesteps_s=(0.001, 0.002))
    assert chosen.best is not None
