"""Extreme inputs: no hang, no false "stable", every verdict certified or undecided with a reason."""

from math import inf, isfinite, nan, sqrt

import mujoco
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.stability.bisection import SearchResult, find_threshold
from grader.numerics.stability.limit import find_spectral_limit
from grader.numerics.stability.servo import Servo
from grader.numerics.stability.trials import Stability, check_bracket, try_timestep
from grader.numerics.stepping import STEPS_MAX
from numerics.models import LESSON

EULER, RK4, IMPLICIT, IMPLICITFAST, DISCRETE = range(5)
GRAVITY_ARM = 9.81 * 0.5


def servo_scene(kp: float, kv: float, mass_ratio: float = 1.0, q0: float = 1.0) -> Scene:
    def parameters(model: mujoco.MjModel) -> None:
        model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1:3] = kp, (-kp, -kv)
        model.body_mass[1] *= mass_ratio
        model.body_inertia[1] *= mass_ratio
        mujoco.mj_setConst(model, mujoco.MjData(model))

    return Scene.from_xml(LESSON["pendulum_servo"]).changed(parameters).at(qpos=[q0])


def closed_form(integrator: int, kp: float, kv: float, mass_ratio: float = 1.0) -> float:
    servo = Servo(0.2501 * mass_ratio, kp, kv, GRAVITY_ARM * mass_ratio)
    return {
        EULER: servo.euler_s,
        IMPLICIT: servo.implicit_s,
        IMPLICITFAST: servo.implicit_s,
        RK4: servo.rk4_s,
        DISCRETE: servo.discrete_s,
    }[integrator]


log_uniform = st.floats(0.0, 1.0)
integrators = st.sampled_from([EULER, RK4, IMPLICIT, IMPLICITFAST])
thorough = settings(max_examples=60)


@thorough
@example(log_kp=4.375, log_mass=1.96875, damping=2.0, integrator=IMPLICIT)  # gravity has a share of 1 / 53
@given(
    log_kp=st.floats(-2, 8),
    log_mass=st.floats(-6, 6),
    damping=st.floats(0, 3),
    integrator=integrators,
)
def test_closed_form_spectral_radius_and_simulation_agree(
    log_kp: float, log_mass: float, damping: float, integrator: int
) -> None:
    """Random (I, kp, kv): the spectral limit is the closed form to 1e-4; stable 2 % below it, and not 2 % above.

    The start is small, so that gravity is linear; the horizon is 4,000 steps. Where gravity holds the joint by a share
    of its stiffness, motions beyond the limit may grow only until sin q bounds them; MuJoCo never warns, and the trial
    says so. As sin q / q lies between -0.22 and 1, a large motion loses at most 1.22 of that share, and where the limit
    goes with the inverse of the stiffness a loss of 1 - 1 / 1.02 suffices: a share of 1 / 62.
    """
    kp, mass = 10**log_kp, 10**log_mass
    inertia = 0.2501 * mass
    kv = damping * sqrt((kp + GRAVITY_ARM * mass) * inertia)
    limit = closed_form(integrator, kp, kv, mass)
    q0 = min(1e-3, 1e6 * inertia / (kp + GRAVITY_ARM * mass))  # its acceleration must not be a warning in itself
    scene = servo_scene(kp, kv, mass, q0=q0)
    edge_s = find_spectral_limit(scene, low_s=limit / 3, high_s=limit * 3, integrator=integrator, width_s=1e-7 * limit)
    assert edge_s == pytest.approx(limit, rel=1e-4)
    below = try_timestep(scene, 0.98 * limit, 0.98 * limit * 4000, integrator=integrator)
    above = try_timestep(scene, 1.02 * limit, 1.02 * limit * 4000, integrator=integrator)
    assert below.stability is Stability.STABLE
    assert above.stability is Stability.UNSTABLE or (
        kp < 62 * GRAVITY_ARM * mass and "small motions grow" in above.reason
    )


@thorough
@given(
    kp=st.floats(-2, 8),
    kv=st.floats(-4, 4),
    mass=st.floats(-6, 6),
    timestep=st.floats(-6, 0),
    q0=st.floats(-1e3, 1e3),
    integrator=st.sampled_from(range(5)),
)
def test_every_verdict_is_decided_or_says_why_not(
    kp: float, kv: float, mass: float, timestep: float, q0: float, integrator: int
) -> None:
    """Small horizons keep it short. Beyond twice the closed-form limit at the rest angle nothing is stable.

    Except where gravity is stronger than the servo: then there are other rest angles, and the run may end in one.
    """
    scene = servo_scene(10**kp, 10**kv, 10**mass, q0)
    h = 10**timestep
    trial = try_timestep(scene, h, max(h * 300, 0.003), integrator=integrator)
    assert trial.reason
    limit = closed_form(integrator, 10**kp, 10**kv, 10**mass)
    run = simulate(scene, seconds=max(h * 300, 0.003), timestep_s=h, integrator=integrator, skip=False, every=STEPS_MAX)
    if h > 2 * limit and abs(q0) > 1e-2 and trial.stability is Stability.STABLE:
        assert 10**kp < GRAVITY_ARM * 10**mass
        assert abs(run.qvel[-1, 0]) < 1e-3 * abs(run.qpos[-1, 0])
    assert (trial.stability is Stability.UNSTABLE) <= (run.diverged_at_step is not None)


@pytest.mark.parametrize("low", [nan, inf, -inf, 0.0, -0.01, 1e-300])
@pytest.mark.parametrize("high", [nan, inf, 0.0, -1.0])
def test_meaningless_claims_are_undecided(low: float, high: float) -> None:
    certificate = check_bracket(servo_scene(2000, 5), low, high, integrator=EULER)
    assert certificate.holds is None
    assert certificate.low.reason and certificate.high.reason


@pytest.mark.parametrize("horizon_s", [nan, inf, 0.0, -3.0])
def test_meaningless_horizons_are_undecided(horizon_s: float) -> None:
    certificate = check_bracket(servo_scene(2000, 5), 0.02, 0.0204, horizon_s, integrator=EULER)
    assert certificate.holds is None
    assert "horizon" in certificate.low.reason


@pytest.mark.parametrize(
    ("start", "phrase"),
    [(nan, "warns of the start"), (inf, "warns of the start"), (1e9, "warns of the start"), (0.0, "at rest")],
)
def test_a_start_that_says_nothing_is_undecided(start: float, phrase: str) -> None:
    for integrator in range(5):
        for h in (0.001, 0.02, 0.1):
            trial = try_timestep(servo_scene(2000, 5, q0=start), h, 3.0, integrator=integrator)
            assert trial.stability is Stability.UNDECIDED
            assert phrase in trial.reason


def test_a_model_full_of_nan_is_undecided() -> None:
    trial = try_timestep(servo_scene(nan, 5), 0.01, 3.0, integrator=EULER)
    assert trial.stability is Stability.UNDECIDED


def test_a_horizon_of_too_many_steps_is_undecided_at_once() -> None:
    trial = try_timestep(servo_scene(2000, 5), 1e-9, 3.0, integrator=EULER)
    assert (trial.stability, "more than" in trial.reason) == (Stability.UNDECIDED, True)


@pytest.mark.parametrize("timestep_s", [0.3, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("integrator", [EULER, RK4, IMPLICIT, IMPLICITFAST])
def test_a_horizon_of_three_steps_makes_nothing_stable(timestep_s: float, integrator: int) -> None:
    assert try_timestep(servo_scene(2000, 5), timestep_s, 3.0, integrator=integrator).stability is not Stability.STABLE


@pytest.mark.parametrize("integrator", [EULER, RK4, IMPLICITFAST])
@pytest.mark.parametrize("kp", [1e-2, 1.0, 1e4, 1e8])
def test_near_the_limit_from_both_sides(kp: float, integrator: int) -> None:
    """h * omega within 1e-3 of the limit; where gravity is stronger than the servo, large motions are bounded."""
    limit = closed_form(integrator, kp, 0.0)
    scene = servo_scene(kp, 0.0, q0=1e-3)
    below = try_timestep(scene, 0.999 * limit, 10_000 * limit, integrator=integrator)
    above = try_timestep(scene, 1.001 * limit, 10_000 * limit, integrator=integrator)
    assert below.stability is Stability.STABLE
    if kp > GRAVITY_ARM:
        assert above.stability is Stability.UNSTABLE
    else:
        assert "small motions grow" in above.reason


def test_a_search_that_is_unstable_throughout_says_so() -> None:
    scene = servo_scene(1e8, 0)
    threshold = find_threshold(scene, low_s=0.001, high_s=0.05, integrator=EULER)
    assert (threshold.result, threshold.bracket_s) == (SearchResult.NONE_STABLE, None)


def test_a_search_from_rest_is_undecided() -> None:
    threshold = find_threshold(servo_scene(2000, 5, q0=0.0), low_s=0.001, high_s=0.05, integrator=EULER)
    assert (threshold.result, threshold.bracket_s) == (SearchResult.UNDECIDED, None)
    assert "at rest" in threshold.reason


@pytest.mark.parametrize("ends", [(0.0, 0.05), (0.05, 0.05), (0.05, 0.01), (nan, 0.05), (0.01, inf)])
def test_an_empty_search_is_refused(ends: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="cannot search"):
        find_threshold(servo_scene(2000, 5), low_s=ends[0], high_s=ends[1])
    with pytest.raises(ValueError, match="cannot search"):
        find_spectral_limit(servo_scene(2000, 5), low_s=ends[0], high_s=ends[1])


def test_start_angles_to_a_thousand_radians() -> None:
    for q0 in np.geomspace(0.01, 1e3, 6):
        threshold = find_threshold(servo_scene(2000, 5, q0=float(q0)), low_s=0.015, high_s=0.03, integrator=EULER)
        assert threshold.bracket_s is not None
        assert isfinite(threshold.bracket_s[0])
        assert 0.01998 < threshold.bracket_s[0] < threshold.bracket_s[1] < 0.0204
