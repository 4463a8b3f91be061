"""References against second sources."""

from collections.abc import Callable
from math import cos, inf, nan, pi, sin

import numpy as np
import pytest
import scipy

from grader.numerics.accuracy import reference as references
from grader.numerics.accuracy.convergence import measure_distance
from grader.numerics.accuracy.reference import list_sample_times, solve, solve_dop853
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene, Vector
from numerics.equations import DoublePendulum, Pendulum
from numerics.models import ALL, CUBE, DELAY, LESSON, RUNAWAY, hinge

TIMES = list_sample_times(1.0, 0.02)
DOUBLE = Scene.from_xml(LESSON["double_pendulum"], key="release")
PENDULUM = Scene.from_xml(LESSON["pendulum"], key="horizontal")
RK4 = 1


def double_pendulum_by_hand(_time: float, y: Vector) -> list[float]:
    return [float(y[2]), float(y[3]), *DoublePendulum().acceleration(*y)]


def pendulum_by_hand(_time: float, y: Vector) -> list[float]:
    return [float(y[1]), Pendulum().acceleration(float(y[0]))]


@pytest.mark.parametrize(
    ("scene", "rate"), [(DOUBLE, double_pendulum_by_hand), (PENDULUM, pendulum_by_hand)], ids=["double", "single"]
)
def test_the_models_equations_are_those_by_hand(scene: Scene, rate: Callable[[float, Vector], list[float]]) -> None:
    reference = solve_dop853(scene, TIMES)
    by_hand = solve(rate, np.concatenate([scene.start.qpos, scene.start.qvel]), TIMES)
    assert np.abs(by_hand[:, : scene.model.nq] - reference.qpos).max() < 1e-12
    assert np.abs(by_hand[:, scene.model.nq :] - reference.qvel).max() < 5e-12


def test_the_pendulum_has_its_elliptic_period() -> None:
    """From rest at the horizontal the period is 4 K(sin^2(pi/4)) sqrt(I / m g L)."""
    hand = Pendulum()
    period = 4 * scipy.special.ellipk(0.5) * np.sqrt(hand.inertia / (hand.mass * 9.81 * hand.length))
    reference = solve_dop853(PENDULUM, [period / 4, period / 2, period])
    assert reference.qpos[:, 0] == pytest.approx([0.0, -pi / 2, pi / 2], abs=1e-11)


def test_mujocos_rk4_reaches_the_reference() -> None:
    """The floor is rounding: 20,000 steps of 0.05 ms leave 7e-14 rad."""
    reference = solve_dop853(DOUBLE, [0.5, 1.0])
    run = simulate(DOUBLE, seconds=1.0, timestep_s=5e-5, integrator=RK4, at_s=[0.5, 1.0])
    assert measure_distance(DOUBLE, run, reference).qpos < 1e-12


@pytest.mark.parametrize("name", ["free_body", "sprung_body", "ball"])
def test_quaternions_stay_unit_and_agree_with_themselves(name: str) -> None:
    scene = Scene.from_xml(ALL[name], key="spin")
    reference = solve_dop853(scene, TIMES)
    quaternions = reference.qpos[:, -4:]
    assert np.linalg.norm(quaternions, axis=1) == pytest.approx(1.0, abs=1e-14)
    looser = solve_dop853(scene, TIMES, rtol=1e-12)
    assert measure_distance(scene, looser, reference).qpos < 1e-10


def test_torque_free_spin_about_a_principal_axis() -> None:
    scene = Scene.from_xml(ALL["free_body"], key="spin").at(qvel=[0, 0, 0, 0, 0, 2.0])
    reference = solve_dop853(scene, TIMES)
    assert reference.qpos[-1, 3] == pytest.approx(cos(1.0), abs=1e-13)


def test_contacts_have_no_smooth_reference() -> None:
    with pytest.raises(ValueError, match="contacts"):
        solve_dop853(Scene.from_xml(CUBE), TIMES)


@pytest.mark.parametrize(
    ("scene", "why"),
    [
        (DELAY, "delays"),
        (ALL["activations"], "limited activations"),
        (
            hinge(rest="<actuator><dcmotor joint='hinge' motorconst='1' resistance='1' inductance='1'/></actuator>"),
            "dcmotor",
        ),
        (hinge(rest="<option><flag sleep='enable'/></option>"), "sleeping"),
    ],
)
def test_what_acts_step_by_step_has_no_reference(scene: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        solve_dop853(Scene.from_xml(scene), TIMES)


def test_an_early_activation_acts_at_once_in_the_limit() -> None:
    """The model's own timestep, 2 ms, moves the motion by 2e-3 rad."""
    filtered = "<general joint='hinge' dyntype='filterexact' dynprm='0.1' gainprm='2' actearly='true'/>"
    scene = Scene.from_xml(hinge("damping='0.5'", rest=f"<actuator>{filtered}</actuator>")).at(ctrl=[1.0])

    def by_hand(_time: float, y: Vector) -> list[float]:
        q, v, act = y.tolist()
        return [v, (2 * act - 0.5 * v - 9.81 * 0.5 * sin(q)) / 0.251, (1 - act) / 0.1]

    states = solve(by_hand, np.zeros(3), TIMES)
    assert np.abs(solve_dop853(scene, TIMES).qpos - states[:, :1]).max() < 1e-12


@pytest.mark.parametrize("times", [[], [0.0], [-1.0, 1.0], [1.0, 0.5], [0.1, 0.1], [nan], [0.1, nan, 0.3], [inf]])
def test_times_that_do_not_go_on_are_refused(times: list[float]) -> None:
    with pytest.raises(ValueError, match="ascend"):
        solve_dop853(PENDULUM, times)


def test_times_beyond_the_clock_are_refused() -> None:
    with pytest.raises(ValueError, match="ascend"):
        solve_dop853(PENDULUM.at(time_s=1e17), [0.1])


@pytest.mark.parametrize("rate", [inf, nan])
def test_rates_that_are_no_numbers_end_it_at_once(rate: float) -> None:
    with pytest.raises(RuntimeError, match="without bound"):
        solve(lambda _time, _state: [rate], np.ones(1), [1.0])


def test_a_motion_that_grows_without_bound_ends() -> None:
    with pytest.raises(RuntimeError, match="without bound"):
        solve_dop853(Scene.from_xml(RUNAWAY, key=0), [2.0], rtol=1e-6)


def test_it_gives_up_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(references, "EVALUATIONS_MAX", 1000)
    with pytest.raises(RuntimeError, match="gave up after 1008 evaluations"):
        solve_dop853(DOUBLE, [20.0])


def test_a_quaternion_and_its_negative_are_the_same_rotation() -> None:
    scene = Scene.from_xml(ALL["ball"])
    quaternion = np.array([0.5, 0.5, 0.5, 0.5])
    one = simulate(scene.at(qpos=quaternion), steps=0)
    other = simulate(scene.at(qpos=-quaternion), steps=0)
    turned = simulate(scene.at(qpos=[cos(0.1), 0.0, 0.0, np.sin(0.1)]), steps=0)
    assert measure_distance(scene, one, other).qpos == pytest.approx(0, abs=1e-15)
    assert measure_distance(scene, simulate(scene, steps=0), turned).qpos == pytest.approx(0.2, abs=1e-12)
