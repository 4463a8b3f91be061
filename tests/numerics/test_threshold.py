"""The largest stable timestep: simulated, linearised and in closed form."""

import math

import mujoco
import numpy as np
import pytest

from grader.numerics.scene import Scene
from grader.numerics.stability.bisection import SearchResult, find_threshold
from grader.numerics.stability.equilibrium import find_equilibrium
from grader.numerics.stability.limit import find_spectral_limit
from grader.numerics.stability.linear import difference_step, linearise_step
from grader.numerics.stability.servo import Servo
from grader.numerics.stability.trials import Criterion, Stability, check_bracket, try_timestep
from numerics.models import ALL, DELAY, LESSON

EULER, RK4, IMPLICIT, IMPLICITFAST, DISCRETE = range(5)
US = 1e-6


def servo_scene(kp: float = 2000, kv: float = 5, mass: float = 1.0, q0: float = 1.0) -> Scene:
    def parameters(model: mujoco.MjModel) -> None:
        model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1:3] = kp, (-kp, -kv)
        model.body_mass[1] *= mass
        model.body_inertia[1] *= mass
        mujoco.mj_setConst(model, mujoco.MjData(model))

    return Scene.from_xml(LESSON["pendulum_servo"]).changed(parameters).at(qpos=[q0])


SERVO = servo_scene()
TABLE_MS = {
    EULER: (20.116, 20.014, 20.009, 19.983),
    IMPLICIT: (25.194, 25.019, 25.011, 24.970),
    IMPLICITFAST: (25.194, 25.019, 25.011, 24.970),
    RK4: (33.677, 33.109, 33.057, 33.010),
}


@pytest.mark.parametrize("integrator", TABLE_MS)
@pytest.mark.parametrize(("column", "horizon_s"), [(0, 3.0), (1, 30.0), (2, 300.0)])
@pytest.mark.slow
def test_table_of_simulated_limits(integrator: int, column: int, horizon_s: float) -> None:
    limit_s = TABLE_MS[integrator][column] / 1000
    threshold = find_threshold(
        SERVO,
        low_s=limit_s - 0.002,
        high_s=limit_s + 0.002,
        horizon_s=horizon_s,
        integrator=integrator,
        scan_step_s=0.001,
    )
    assert threshold.bracket_s is not None
    low, high = threshold.bracket_s
    assert high - low <= 1 * US
    assert abs(0.5 * (low + high) - limit_s) <= 1 * US
    assert threshold.low is not None and threshold.low.stability is Stability.STABLE
    assert threshold.high is not None and threshold.high.stability is Stability.UNSTABLE


@pytest.mark.parametrize("integrator", TABLE_MS)
def test_table_of_linear_stability_limits(integrator: int) -> None:
    limit = find_spectral_limit(SERVO, low_s=0.001, high_s=0.2, integrator=integrator)
    assert limit == pytest.approx(TABLE_MS[integrator][3] / 1000, abs=1 * US)


def test_discrete_has_no_limit() -> None:
    assert find_threshold(SERVO, low_s=0.001, high_s=0.2, integrator=DISCRETE).result is SearchResult.ALL_STABLE
    assert find_spectral_limit(SERVO, low_s=0.001, high_s=0.2, integrator=DISCRETE) is None


def test_discrete_with_pgs_is_explicit() -> None:
    pgs = SERVO.changed(lambda model: setattr(model.opt, "solver", int(mujoco.mjtSolver.mjSOL_PGS)))
    threshold = find_threshold(pgs, low_s=0.001, high_s=0.05, integrator=DISCRETE)
    assert threshold.bracket_s == pytest.approx((20.116e-3, 20.117e-3), abs=1 * US)


def test_windows_of_rk4_under_the_lessons_criterion() -> None:
    """BADQVEL fires first there and resets the state, so a script that only counts BADQACC sees stability."""
    search = {"low_s": 0.03, "high_s": 0.16, "integrator": RK4, "scan_step_s": 0.0004, "width_s": 1e-5}
    naive = find_threshold(SERVO, criterion=Criterion.BADQACC, **search)  # type: ignore[arg-type]
    edges_ms = [(1000 * window.low_s, 1000 * window.high_s) for window in naive.windows]
    assert edges_ms == [pytest.approx((57.37, 57.84), abs=0.02), pytest.approx((129.5, 146.6), abs=0.05)]
    assert find_threshold(SERVO, **search).windows == ()  # type: ignore[arg-type]


def test_closed_forms_of_the_lessons_servo() -> None:
    held = Servo(0.2501, 2000, 5, 0.5 * 9.81)
    assert held.euler_s == pytest.approx(19.983e-3, abs=1 * US)
    assert held.implicit_s == pytest.approx(24.970e-3, abs=1 * US)
    assert held.rk4_s == pytest.approx(33.010e-3, abs=1 * US)
    bare = Servo(0.2501, 2000, 5)
    assert 1000 * bare.euler_s == pytest.approx(20.004, abs=1e-3)
    assert 1000 * bare.implicit_s == pytest.approx(25.004, abs=1e-3)
    assert 1000 * bare.rk4_s == pytest.approx(33.051, abs=1e-3)
    assert 1000 * bare.bound_s == pytest.approx(22.365, abs=1e-3)


def test_a_claim_is_checked_by_two_simulations() -> None:
    assert check_bracket(SERVO, 0.0200, 0.0204, integrator=EULER).holds is True
    assert check_bracket(SERVO, 0.0190, 0.0195, integrator=EULER).holds is False
    assert check_bracket(SERVO, 0.0210, 0.0215, integrator=EULER).holds is False
    assert check_bracket(SERVO, 0.0200, 0.0204, integrator=DISCRETE).holds is False


@pytest.mark.parametrize("integrator", TABLE_MS)
@pytest.mark.parametrize("horizon_s", [3.0, 30.0])
def test_the_linear_prediction_saves_simulations(integrator: int, horizon_s: float) -> None:
    """Halving a range of 49 ms to 1 us alone takes 16 runs after the two ends."""
    threshold = find_threshold(
        SERVO, low_s=0.001, high_s=0.05, horizon_s=horizon_s, integrator=integrator, scan_step_s=0.05, width_s=1e-6
    )
    assert threshold.bracket_s is not None
    assert threshold.simulations <= 2 + 12


def test_a_threshold_says_under_what_it_holds() -> None:
    threshold = find_threshold(SERVO, low_s=0.015, high_s=0.025, horizon_s=7.0, integrator=EULER, scan_step_s=0.001)
    assert (threshold.horizon_s, threshold.criterion, threshold.integrator) == (7.0, Criterion.ANY_WARNING, EULER)
    assert threshold.start.qpos.tolist() == [1.0]
    assert 0.0009 < threshold.scan_step_s <= 0.001
    assert threshold.low is not None and threshold.high is not None
    assert "no warning" in threshold.low.reason and "warning within" in threshold.high.reason


def test_differences_agree_with_mujocos_own_linearisation() -> None:
    scene = SERVO.at(qpos=[0.3], qvel=[0.5])
    for integrator in (EULER, IMPLICIT, IMPLICITFAST, DISCRETE):
        with scene.borrow(timestep_s=0.004, integrator=integrator) as workspace:
            differenced = difference_step(workspace.model, workspace.data)
        own = linearise_step(scene, timestep_s=0.004, integrator=integrator)
        assert np.abs(differenced - own).max() < 1e-6


def test_an_equilibrium_is_where_nothing_accelerates() -> None:
    pushed = SERVO.at(ctrl=[0.5])
    rest = find_equilibrium(pushed)
    assert rest is not None
    angle = float(rest.start.qpos[0])
    assert 2000 * (0.5 - angle) == pytest.approx(9.81 * 0.5 * np.sin(angle), abs=1e-5)
    assert find_equilibrium(Scene.from_xml(ALL["free_body"]).changed(falling)) is None


def falling(model: mujoco.MjModel) -> None:
    model.opt.gravity[2] = -9.81


def pendulum(name: str, z: float = -0.5, joint: str = "") -> str:
    return f"""<body><joint name="{name}" axis="0 1 0" {joint}/>
    <inertial pos="0 0 {z}" mass="1" diaginertia="1e-4 1e-4 1e-4"/></body>"""


def scene(bodies: str, actuators: str) -> Scene:
    return Scene.from_xml(f"<mujoco><worldbody>{bodies}</worldbody><actuator>{actuators}</actuator></mujoco>")


SOFT = "<position joint='a' kp='20' kv='0'/>"
"""Its linear stability limit is 0.2004 s; beyond it gravity bounds the motion, and MuJoCo never warns."""
WHIRL = scene(pendulum("a"), SOFT)
DAMPED = scene(pendulum("a") + pendulum("b", joint="damping='1e4'"), SOFT)
FREE = "<body pos='5 0 1'><freejoint/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body>"
FALLING = scene(pendulum("a") + FREE, SOFT)
BRAKE = "<velocity joint='a' kv='60' forcerange='-20 20'/>"
UPRIGHT = scene(pendulum("a", z=0.5), BRAKE)


@pytest.mark.parametrize(
    ("moving", "timestep_s"),
    [
        (WHIRL.at(qvel=[1]), 0.215),
        (WHIRL.at(qvel=[1e-3]), 0.215),
        (scene(pendulum("a"), SOFT.replace("kv='0'", "kv='0.01'")).at(qpos=[1e6]), 0.204),
        (DAMPED.at(qpos=[1, 0], qvel=[0, 100]), 0.215),
        (FALLING.at(qpos=[1, 5, 0, 1, 1, 0, 0, 0]), 0.215),
        (UPRIGHT.at(qpos=[1]), 0.01),
        (UPRIGHT.at(qpos=[1]), 2.2),
    ],
    ids=["pushed", "nudged", "far out", "beside a larger motion", "beside a fall", "upright", "far beyond the limit"],
)
def test_numerical_growth_that_is_bounded_is_undecided(moving: Scene, timestep_s: float) -> None:
    trial = try_timestep(moving, timestep_s, 4000 * timestep_s, integrator=EULER)
    assert trial.stability is Stability.UNDECIDED
    assert "large ones are bounded" in trial.reason


@pytest.mark.parametrize(
    ("moving", "timestep_s", "integrator"),
    [
        (WHIRL.at(qvel=[1]), 0.2, EULER),
        (DAMPED.at(qpos=[1, 0], qvel=[0, 100]), 0.2, EULER),
        (UPRIGHT.at(qpos=[1]), 0.002, EULER),
        (scene(pendulum("a", z=0.5), "").at(qpos=[1]), 0.05, RK4),
    ],
    ids=["pushed", "beside a larger motion", "upright", "upright and long steps"],
)
def test_growth_of_the_exact_motion_is_stable(moving: Scene, timestep_s: float, integrator: int) -> None:
    assert try_timestep(moving, timestep_s, 30, integrator=integrator).stability is Stability.STABLE


def test_a_delay_is_undecided() -> None:
    delayed = try_timestep(Scene.from_xml(DELAY).at(qpos=[1]), 0.002, 3)
    assert (delayed.stability, "delays are not supported" in delayed.reason) == (Stability.UNDECIDED, True)


def test_a_bracket_that_descends_is_refused() -> None:
    with pytest.raises(ValueError, match="must ascend"):
        check_bracket(SERVO, 0.0204, 0.02)


@pytest.mark.parametrize("scan_step_s", [0.0, -1.0, float("nan")])
def test_a_scan_in_no_steps_is_refused(scan_step_s: float) -> None:
    with pytest.raises(ValueError, match="cannot scan"):
        find_threshold(SERVO, low_s=0.01, high_s=0.02, scan_step_s=scan_step_s)


def test_the_closed_form_does_not_cancel() -> None:
    """With kp << kv the damper alone counts: 2 I / kv."""
    assert Servo(1.0, 1e-9, 1e3).euler_s == pytest.approx(2e-3, rel=1e-12)


@pytest.mark.parametrize(
    "numbers", [(1, -2, 1, 3), (1, 1, -1, 0), (1, 1, 1, -1), (math.inf, 1, 1, 0), (1, math.inf, 1, 0)]
)
def test_the_closed_forms_hold_for_a_spring_that_pulls_back(numbers: tuple[float, float, float, float]) -> None:
    """MuJoCo's discrete integrator treats a spring implicitly, and one that pushes explicitly."""
    with pytest.raises(ValueError, match="the closed forms need"):
        Servo(*numbers)


def test_without_a_spring_the_lessons_bound_is_none() -> None:
    assert Servo(1.0, 0.0, 1.0, 2.0).bound_s == math.inf
