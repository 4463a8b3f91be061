"""Claims about motions with closed forms: the true ones are certified, the false ones never; each truth is a formula.

A claim counts as true or false by mathematics alone: no expected value here comes from the certifying code.
"""

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy

from certify.test_certify import certify, numeric, predict

pytestmark = pytest.mark.slow

# One joint: a mass [kg] on a rail, with a spring [N/m] and a damper [N s/m].
MASS, SPRING, DAMPER, START = 2.0, 50.0, 4.0, 0.1
RATE, DECAY = math.sqrt(SPRING / MASS), DAMPER / (2 * MASS)
SWING = math.sqrt(RATE**2 - DECAY**2)

# A rod's end mass: a pendulum of length LENGTH [m] with the inertia m l^2 about its hinge.
LENGTH, G = 0.5, 9.81
TILT = 2.0


def rail(
    *, spring: float = 0.0, damper: float = 0.0, h: float = 1e-3, integrator: str = "Euler", gravity: float = 0.0,
    more: str = "",
) -> str:  # fmt: skip
    return f"""<mujoco><option timestep="{h}" integrator="{integrator}" gravity="{gravity} 0 0"/><worldbody><body>
      <joint type="slide" axis="1 0 0" stiffness="{spring}" damping="{damper}"/><geom size=".1" mass="{MASS}"/>
    </body></worldbody>{more}</mujoco>"""


def pendulum(
    *, h: float = 1e-3, z: float = -LENGTH, integrator: str = "RK4", inertia: float = 1e-9, damper: float = 0.0
) -> str:
    """MJCF of a point mass of 1 kg at the height `z` [m] below or above its hinge at qpos = 0."""
    return f"""<mujoco><option timestep="{h}" integrator="{integrator}" gravity="0 0 -{G}"/><worldbody><body>
      <joint axis="0 1 0" damping="{damper}"/>
      <inertial pos="0 0 {z}" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>
    </body></worldbody></mujoco>"""


FILTER = '<actuator><general joint="j" dyntype="filter" dynprm="0.3" gainprm="1"/></actuator>'
SPINNING = """<mujoco><option timestep="0.002" integrator="RK4" gravity="0 0 0"/><worldbody><body><freejoint/>
  <inertial pos="0 0 0" mass="1" diaginertia=".04 .04 .05"/></body></worldbody></mujoco>"""


def swing(t: float) -> float:
    """Position [m] of the damped mass, from START at rest."""
    return START * math.exp(-DECAY * t) * (math.cos(SWING * t) + DECAY / SWING * math.sin(SWING * t))


def swing_by_simulation(t: float) -> float:
    """The same by an independent solver."""
    rate = lambda _, y: [y[1], -(SPRING * y[0] + DAMPER * y[1]) / MASS]  # noqa: E731
    return float(scipy.integrate.solve_ivp(rate, (0, t), [START, 0.0], rtol=1e-11, atol=1e-13).y[0, -1])


def step_map(h: float, seconds: float) -> float:
    """Position [m] after semi-implicit Euler steps of the undamped mass, by powers of its one-step map."""
    w2 = SPRING / MASS
    one = np.array([[1 - h * h * w2, h], [-h * w2, 1]])
    return float((np.linalg.matrix_power(one, round(seconds / h)) @ [START, 0])[0])


def quarter_period() -> float:
    """Time [s] in which the pendulum falls from TILT to the bottom."""
    return float(math.sqrt(LENGTH / G) * scipy.special.ellipk(math.sin(TILT / 2) ** 2))


PULLED = f"data.qpos[0] = {START}"
X, V = "data.qpos[0]", "data.qvel[0]"

MEASURED: dict[str, tuple[float, str, dict[str, Any]]] = {
    "undamped swing": (
        START * math.cos(RATE * 0.7), "m", {"xml": rail(spring=SPRING), "setup": PULLED, "expr": X, "seconds": 0.7}),
    "damped swing": (
        swing(0.7), "m", {"xml": rail(spring=SPRING, damper=DAMPER), "setup": PULLED, "expr": X, "seconds": 0.7}),
    "damped swing by another solver": (
        swing_by_simulation(1.1), "m",
        {"xml": rail(spring=SPRING, damper=DAMPER), "setup": PULLED, "expr": X, "seconds": 1.1}),
    "damped swing under implicitfast": (
        swing(0.7), "m",
        {"xml": rail(spring=SPRING, damper=DAMPER, integrator="implicitfast"), "setup": PULLED, "expr": X,
         "seconds": 0.7}),
    "highest speed": (
        START * RATE, "m/s", {"xml": rail(spring=SPRING), "setup": PULLED, "expr": V, "when": "max", "seconds": 2}),
    "lowest position": (
        swing(math.pi / SWING), "m",
        {"xml": rail(spring=SPRING, damper=DAMPER), "setup": PULLED, "expr": X, "when": "min", "seconds": 2}),
    "free fall": (G / 2, "m", {"xml": rail(gravity=G), "expr": X, "seconds": 1}),
    "speed of free fall": (G, "m/s", {"xml": rail(gravity=G), "expr": V, "seconds": 1}),
    "terminal speed": (
        MASS * G / DAMPER * (1 - math.exp(-2 * DECAY * 0.8)), "m/s",
        {"xml": rail(damper=DAMPER, gravity=G), "expr": V, "seconds": 0.8}),
    "coasting": (
        3 * MASS / DAMPER * (1 - math.exp(-2 * DECAY)), "m",
        {"xml": rail(damper=DAMPER), "setup": "data.qvel[0] = 3", "expr": X, "seconds": 1}),
    "constant force": (
        0.5 * 5 / MASS * 4, "m",
        {"xml": rail(), "controller": "data.qfrc_applied[0] = 5", "expr": X, "seconds": 2}),
    "mean energy": (
        0.5 * SPRING * START**2, "J",
        {"xml": rail(spring=SPRING, integrator="RK4"), "setup": PULLED, "when": "mean",
         "expr": "data.energy[0] + data.energy[1]", "seconds": 1}),
    "fastest at the bottom": (
        math.sqrt(2 * G / LENGTH * (1 - math.cos(TILT))), "rad/s",
        {"xml": pendulum(), "setup": f"data.qpos[0] = {TILT}", "expr": "Math.abs(data.qvel[0])", "when": "max",
         "seconds": 2}),
    "angle of a large swing": (
        0.0, "rad",
        {"xml": pendulum(h=quarter_period() / 500), "setup": f"data.qpos[0] = {TILT}", "expr": X,
         "seconds": quarter_period()}),
    "activation": (
        1 - math.exp(-0.5 / 0.3), "",
        {"xml": rail(more=FILTER).replace("<joint ", '<joint name="j" '), "setup": "data.ctrl[0] = 1",
         "expr": "data.act[0]", "seconds": 0.5}),
    "turn about an axis of inertia": (
        math.sin(0.5), "",
        {"xml": SPINNING, "setup": "data.qvel[5] = 1", "expr": "data.qpos[6]", "seconds": 1}),
    "discretised swing, as given": (
        step_map(0.02, 1.0), "m",
        {"xml": rail(spring=SPRING, h=0.02), "setup": PULLED, "expr": X, "seconds": 1, "timestep": "given"}),
    "implicit damping, as given": (
        3 / (1 + 0.05 * DAMPER / MASS) ** 20, "m/s",
        {"xml": rail(damper=DAMPER, h=0.05), "setup": "data.qvel[0] = 3", "expr": V, "seconds": 1,
         "timestep": "given"}),
}  # fmt: skip
"""True values, their units and how each is measured."""


@pytest.mark.parametrize("name", MEASURED)
def test_a_true_number_is_certified_and_a_false_one_refuted(name: str) -> None:
    value, unit, verify = MEASURED[name]
    tol = 0.01 * max(abs(value), 0.5)
    true = certify(numeric(value, tol, unit, by="measurement", **verify))
    assert (true.verdict, true.regime["failed"]) == ("certified", None), true.why
    for false in (value + 3 * tol, 1.5 * value + 4 * tol, -value - 3 * tol):
        refuted = certify(numeric(false, tol, unit, by="measurement", **verify))
        assert refuted.verdict == "refuted", refuted.why


def quotient(i: float, k: float, c: float) -> float:
    """Largest stable timestep [s] of semi-implicit Euler: h^2 k + 2 h c = 4 i."""
    return (math.sqrt(c * c + 4 * i * k) - c) / k


UPRIGHT = {"xml": pendulum(z=LENGTH), "qpos": [math.pi - 0.1]}
FILTERED = rail(spring=10, damper=DAMPER, more=FILTER).replace("<joint ", '<joint name="j" ')

THRESHOLDS: dict[str, tuple[float, dict[str, Any]]] = {
    "hanging pendulum": (2 / math.sqrt(G / LENGTH), {"xml": pendulum(), "qpos": [0.1]}),
    "defined upright, started hanging": (2 / math.sqrt(G / LENGTH), UPRIGHT),
    "defined upright, under RK4": (2 * math.sqrt(2) / math.sqrt(G / LENGTH), {**UPRIGHT, "integrator": "RK4"}),
    "mass on a spring": (2 / RATE, {"xml": rail(spring=SPRING), "qpos": [START]}),
    "filtered actuator": (0.6, {"xml": FILTERED, "qpos": [START], "integrator": "implicitfast"}),
    "servo": (quotient(0.05, 200.0, 2.0), {"servo": {"inertia": 0.05, "kp": 200, "kv": 2}}),
    "tiny inertia": (quotient(1e-6, 1.0, 1e-4), {"servo": {"inertia": 1e-6, "kp": 1, "kv": 1e-4}}),
}
"""Linear stability limits [s], and where they are sought."""


@pytest.mark.parametrize("name", THRESHOLDS)
def test_a_true_limit_is_certified_and_a_false_one_refuted(name: str) -> None:
    limit, verify = THRESHOLDS[name]
    verify = {"by": "threshold", "low": limit / 20, "high": 2 * limit, **verify}
    true = certify(numeric(limit, 0.01 * limit, "s", **verify))
    assert true.verdict == "certified", true.why
    for wrong in (0.9, 1.1):
        assert certify(numeric(wrong * limit, 0.01 * limit, "s", **verify)).verdict == "refuted"


# A soft servo beside gravity: beyond Euler's limit gravity bounds the motion, so that MuJoCo never warns.
INERTIA = 0.25
GRAVITY_RATE = G * LENGTH


def soft_servo(kp: float, beyond: float, answer: int) -> Any:
    """A question whether the pendulum on a servo is stable at `beyond` times Euler's limit h^2 (kp + m g l) = 4 I."""
    h = beyond * math.sqrt(4 * INERTIA / (kp + GRAVITY_RATE))
    xml = pendulum(integrator="Euler", z=-LENGTH, inertia=1e-9, h=1e-3).replace(
        "</mujoco>", f'<actuator><position joint="j" kp="{kp}"/></actuator></mujoco>'
    )
    choose = {"type": "select", "label": "h", "set": "model.opt.timestep", "options": [["it", h], ["other", h / 50]]}
    sim = {"xml": xml.replace("<joint ", '<joint name="j" '), "controls": [choose], "setup": "data.qpos[0] = 0.3"}
    verify = {"by": "options", "settings": [{"h": "it"}, None], "seconds": 20}
    return predict(["stable", "None of them"], answer, sim, verify)


@pytest.mark.parametrize("kp", [0.05, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("beyond", [1.05, 1.2, 1.35])
def test_a_soft_servo_beyond_its_limit_is_never_certified_stable(kp: float, beyond: float) -> None:
    assert certify(soft_servo(kp, beyond, 0)).verdict == "refuted"
    assert certify(soft_servo(kp, beyond, 1)).verdict == "certified"


@pytest.mark.parametrize("kp", [0.05, 0.2, 0.5, 1.0])
@pytest.mark.parametrize("below", [0.3, 0.6, 0.95])
def test_a_soft_servo_below_its_limit_is_still_certified_stable(kp: float, below: float) -> None:
    assert certify(soft_servo(kp, below, 0)).verdict == "certified"
    assert certify(soft_servo(kp, below, 1)).verdict == "refuted"


def outcome(sim: dict[str, Any], claims: list[Any], answer: int, **verify: Any) -> Any:
    options = [f"option {i}" for i in range(len(claims))]
    return predict(options, answer, sim, {"by": "outcome", "claims": claims, **verify})


BESIDE = {
    "nothing": ("", ""),
    "a box that lies on the floor": ("""<geom type="plane" size="5 5 .1"/><body pos="3 0 .05"><freejoint/>
      <geom type="box" size=".1 .1 .05" mass="2"/></body>""", ""),
    "a slide with dry friction": ("""<body pos="3 0 0"><joint type="slide" axis="1 0 0" frictionloss=".1"/>
      <geom size=".1" contype="0" conaffinity="0"/></body>""", ""),
    "a pendulum that swings on": ("""<body pos="3 0 2"><joint/>
      <geom size=".1" pos="0 0 -1" contype="0" conaffinity="0"/></body>""", ""),
    "a controller": ("", "ctx.n = 1"),
}  # fmt: skip


@pytest.mark.parametrize("beside", BESIDE)
def test_what_is_beside_a_servo_hides_no_growth_that_its_force_limit_bounds(beside: str) -> None:
    """I = 0.05, kv = 15: explicit damping is stable below 2 I/kv = 6.7 ms. Beyond, the limited force keeps up a swing
    of 0.02 rad, of which MuJoCo never warns."""
    others, controller = BESIDE[beside]
    xml = f"""<mujoco><option timestep="0.01" gravity="0 0 -9.81"/><worldbody><body pos="0 0 1">
      <joint name="h" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia=".05 .05 .05"/></body>
      {others}</worldbody><actuator><general joint="h" biastype="affine" gainprm="50" biasprm="0 -50 -15"
      forcelimited="true" forcerange="-5 5"/></actuator></mujoco>"""
    steps = {"type": "select", "label": "h", "set": "model.opt.timestep", "options": [["2 ms", 2e-3], ["20 ms", 2e-2]]}
    sim = {"xml": xml, "setup": "data.qpos[0] = 0.01", "controls": [steps], "controller": controller or None}
    verify = {"by": "options", "criterion": "stable", "seconds": 5, "settings": [{"h": "2 ms"}, {"h": "20 ms"}, None]}
    for answer, verdict in ((0, "certified"), (1, "refuted"), (2, "refuted")):
        certificate = certify(predict(["2 ms", "20 ms", "Both"], answer, sim, verify))
        assert certificate.verdict == verdict, certificate.why


@pytest.mark.parametrize("h", [0.02, 0.01])
@pytest.mark.parametrize("rate", [20.0, 50.0, 120.0, 300.0])
@pytest.mark.parametrize("damping", [0.02, 0.05, 0.1, 0.2, 0.3, 0.5])
def test_overshoot_that_discrete_damps_away_is_never_denied(rate: float, damping: float, h: float) -> None:
    # Source: a damping ratio below 1 overshoots, by exp(-pi d / sqrt(1 - d^2)) of the step.
    xml = rail(spring=MASS * rate**2, damper=2 * MASS * damping * rate, h=h, integrator="discrete")
    sim = {"xml": xml, "setup": "data.qpos[0] = -0.1"}
    size = 0.1 * math.exp(-math.pi * damping / math.sqrt(1 - damping**2))
    claims = [{"expr": f"data.qpos[0] > {0.5 * size}", "when": "ever"},
              {"expr": f"data.qpos[0] <= {0.5 * size}", "when": "always"}]  # fmt: skip
    assert certify(outcome(sim, claims, 1, seconds=1, timestep="any")).verdict == "refuted"
    if h == 0.02 and damping in (0.02, 0.1, 0.3):  # elsewhere the false claim alone, which the sweep is about
        assert certify(outcome(sim, claims, 0, seconds=1, timestep="any")).verdict == "certified"


PERIOD = 1e-3 / 64
SAME_PHASE = {"xml": rail(), "controller": f"data.qfrc_applied[0] = Math.cos(2 * Math.PI * data.time / {PERIOD})"}
BRIEF = {
    "xml": rail(h=0.01),
    "controller": "data.qfrc_applied[0] = data.time > 0.0921 && data.time < 0.0929 ? 1e4 : 0",
}
BLOWS_UP = rail(spring=SPRING, h=0.5)
INVERTED = {"xml": pendulum(z=LENGTH), "setup": "data.qpos[0] = 0"}
EXPLODES = {"xml": BLOWS_UP, "setup": PULLED}

FALSE: dict[str, tuple[Callable[[], Any], str]] = {
    # Source: the force averages to 0, and moves the mass by F (T / 2 pi)^2 / m at most.
    "a force that every halving meets in the same phase": (
        lambda: numeric(0.25, 0.01, "m", by="measurement", expr=X, seconds=1, **SAME_PHASE), "incommensurate timestep"),
    "a force shorter than every timestep, with its rate": (
        lambda: numeric(0, 0.01, "m/s", by="measurement", expr=V, seconds=0.2, fastest=5000, **BRIEF), "any"),
    # Source: the spring bounds the motion by START.
    "a number behind a reset": (
        lambda: numeric(0, 0.5, "m", by="measurement", expr=X, seconds=60, **EXPLODES), "no reset"),
    "the end behind a reset": (
        lambda: outcome(EXPLODES, ["data.qpos[0] > 2", "data.qpos[0] <= 2"], 1, seconds=60), "no reset"),
    "a balance that a nudge ends": (
        lambda: numeric(0, 0.01, "rad", by="measurement", expr=X, seconds=8, **INVERTED), "nudged starts"),
    # Source: energy is conserved, and at h w = 0.5 semi-implicit Euler shows other numbers.
    "the drift of a long timestep as physics": (
        lambda: numeric(step_map(0.1, 1.0), 1e-3, "m", by="measurement", xml=rail(spring=SPRING, h=0.1), setup=PULLED,
                        expr=X, seconds=1), "any"),
    "the motion, where the page shows other numbers": (
        lambda: numeric(START * math.cos(RATE), 1e-4, "m", by="measurement", xml=rail(spring=SPRING, h=0.1),
                        setup=PULLED, expr=X, seconds=1), "own timestep"),
}  # fmt: skip
"""Keys that are false or cannot be told, and the condition that fails."""


@pytest.mark.parametrize("name", FALSE)
def test_what_timesteps_agree_on_by_accident_is_never_certified(name: str) -> None:
    make, failed = FALSE[name]
    certificate = certify(make())
    assert certificate.verdict != "certified", certificate.why
    if failed != "any":
        assert (certificate.verdict, certificate.regime["failed"]) == ("cannot tell", failed), certificate.why


@pytest.mark.parametrize(
    ("timestep", "verdicts"),
    [("given", ["certified", "refuted"]), ("any", ["refuted", "certified"]), ("both", ["cannot tell"] * 2)],
)
def test_what_was_decided_before_a_reset_is_true_of_the_run_and_not_of_the_motion(
    timestep: str, verdicts: list[str]
) -> None:
    # Source: the spring bounds the motion by START = 0.1; the run at h w = 2.5 has grown beyond 0.15 before the reset.
    claims = [{"expr": "Math.abs(data.qpos[0]) > 0.15", "when": "ever"},
              {"expr": "Math.abs(data.qpos[0]) <= 0.15", "when": "always"}]  # fmt: skip
    certificates = [certify(outcome(EXPLODES, claims, answer, seconds=60, timestep=timestep)) for answer in (0, 1)]
    assert [certificate.verdict for certificate in certificates] == verdicts


@pytest.mark.parametrize("timestep", ["both", "any", "given"])
def test_what_a_key_is_about_decides_whether_it_is_certified(timestep: str) -> None:
    h = 0.1
    motion, shown = START * math.cos(RATE), step_map(h, 1.0)
    verify = {"by": "measurement", "xml": rail(spring=SPRING, h=h), "setup": PULLED, "expr": X, "seconds": 1}
    verdicts = {key: certify(numeric(key, 1e-3, "m", **verify, timestep=timestep)).verdict for key in (motion, shown)}
    assert abs(motion - shown) > 0.01
    expected = {"both": ("cannot tell", "refuted"), "any": ("certified", "refuted"), "given": ("refuted", "certified")}
    assert tuple(verdicts.values()) == expected[timestep]


def test_a_key_that_cannot_be_told_is_published_for_a_reason_in_writing_alone() -> None:
    verify = {"by": "measurement", "expr": X, "seconds": 1, **SAME_PHASE}
    refused = certify(numeric(0.25, 0.01, "m", **verify))
    assert not refused.is_publishable
    accepted = certify(numeric(0.25, 0.01, "m", **verify, accept="Derived by hand in chapter 3"))
    assert (accepted.verdict, accepted.is_publishable) == ("cannot tell", True)
    assert accepted.to_json()["accepted"] == "Derived by hand in chapter 3"
    fall = {"by": "measurement", "xml": rail(gravity=G), "expr": V, "seconds": 1, "accept": "Derived by hand"}
    refuted = certify(numeric(2 * G, 0.01, "m/s", **fall))
    assert (refuted.verdict, refuted.is_publishable, refuted.accepted) == ("refuted", False, None)
    needless = certify(numeric(G, 0.1, "m/s", **fall))
    assert (needless.verdict, needless.accepted) == ("certified", None)
    assert "no longer needed" in needless.remarks[-1]
    broken = certify(numeric(G, 0.1, "m/s", **{**fall, "expr": "data.nothing[0]"}))
    assert not broken.is_publishable


def test_a_number_that_the_last_stage_of_rk4_spoils_is_certified_with_a_remark() -> None:
    # Source: energy is conserved; RK4 at 40 ms loses 2e-5 of it, and its last stage is 1e-4 off.
    verify = {"by": "measurement", "xml": pendulum(h=0.04), "setup": f"data.qpos[0] = {TILT}", "seconds": 1}
    energy = -G * LENGTH * math.cos(TILT)
    derived = certify(numeric(energy, 3e-4, "J", **verify, expr="data.energy[0] + data.energy[1]"))
    assert derived.verdict == "certified", derived.why
    assert any("last stage" in remark for remark in derived.remarks)
    loose = certify(numeric(energy, 3e-2, "J", **verify, expr="data.energy[0] + data.energy[1]"))
    assert (loose.verdict, loose.remarks) == ("certified", ())


def test_a_run_that_is_no_multiple_of_the_timestep_says_which_length_or_timestep_to_write() -> None:
    # Source: x = g t^2 / 2; runs of 0.995 s end 5 ms early or late at 10 ms, which changes x by 5 cm.
    verify = {"by": "measurement", "xml": rail(gravity=G, h=0.01), "expr": X, "timestep": "any"}
    odd = certify(numeric(G / 2 * 0.995**2, 1e-3, "m", seconds=0.995, **verify))
    assert (odd.verdict, odd.regime["failed"]) == ("cannot tell", "whole steps"), odd.why
    cure = re.search(r"write seconds (\S+), or the timestep (\S+) in the model", odd.why)
    assert cure is not None, odd.why
    seconds, h = map(float, cure.groups())
    for length, timestep in ((seconds, 0.01), (0.995, h)):
        cured = {**verify, "xml": rail(gravity=G, h=timestep)}
        certificate = certify(numeric(G / 2 * length**2, 1e-3, "m", seconds=length, **cured))
        assert certificate.verdict == "certified", certificate.why
