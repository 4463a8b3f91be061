"""A table of motions with closed forms, one physics a row: the true number is certified, a false one refuted.

No expected value comes from the certifying code: each is a formula, or a solution of SciPy's on equations by hand.
"""

import math
import re
from typing import Any

import numpy as np
import pytest
import scipy

from certify.test_certify import certify, numeric, predict
from certify.test_claims_by_closed_forms import G, soft_servo

pytestmark = pytest.mark.slow

X, V, TORQUE, ENERGY = "data.qpos[0]", "data.qvel[0]", 'joint="j"', "data.energy[0] + data.energy[1]"
HEAD = '<mujoco><option timestep="{h}" integrator="{integrator}" gravity="{gravity}"/><worldbody>'


def world(body: str, *, more: str = "", h: float = 1e-3, integrator: str = "RK4", gravity: str = "0 0 0") -> str:
    head = HEAD.format(h=h, integrator=integrator, gravity=gravity)
    return f"{head}{body}</worldbody>{more}</mujoco>"


def slide(m: float = 2.0, joint: str = "", axis: str = "1 0 0") -> str:
    return f'<body><joint name="j" type="slide" axis="{axis}" {joint}/><geom size=".1" mass="{m}"/></body>'


def wheel(inertia: float, joint: str = "") -> str:
    return f"""<body><joint name="j" axis="0 0 1" {joint}/>
      <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/></body>"""


def rod(length: float, m: float = 1.0, own: float = 1e-9, joint: str = "") -> str:
    return f"""<body><joint name="j" axis="0 1 0" {joint}/>
      <inertial pos="0 0 {-length}" mass="{m}" diaginertia="{own} {own} {own}"/></body>"""


def free(inertia: str = ".1 .1 .1", at: str = "0 0 0") -> str:
    return f'<body pos="{at}"><freejoint/><inertial pos="0 0 0" mass="2" diaginertia="{inertia}"/></body>'


def actuator(text: str) -> str:
    return f"<actuator>{text}</actuator>"


def solve(rate: Any, start: list[float], seconds: float) -> float:
    return float(scipy.integrate.solve_ivp(rate, (0, seconds), start, rtol=1e-11, atol=1e-13).y[0, -1])


def decay(x: float, k: float, c: float, m: float, t: float) -> float:
    """Position of an overdamped mass from rest at x."""
    a, b = (-c / 2 / m + s * math.sqrt((c / 2 / m) ** 2 - k / m) for s in (1, -1))
    return x * (a * math.exp(b * t) - b * math.exp(a * t)) / (a - b)


def fall_time(angle: float, length: float) -> float:
    """Time [s] in which a pendulum falls from rest at `angle` to the bottom."""
    return float(math.sqrt(length / G) * scipy.special.ellipk(math.sin(angle / 2) ** 2))


DOWN, ACROSS = f"0 0 -{G}", f"{G} 0 0"
COUPLED = """<body><joint type="slide" axis="1 0 0" stiffness="8"/><geom size=".01" mass="1"/></body>
  <body pos="0 1 0"><joint type="slide" axis="1 0 0" stiffness="8"/><geom size=".01" mass="1"/></body>"""
COUPLING = "data.qfrc_applied[0] = 3 * (data.qpos[1] - data.qpos[0]); data.qfrc_applied[1] = -data.qfrc_applied[0]"
TENDON = '<tendon><fixed name="t"><joint joint="j" coef="3"/></fixed></tendon>'
SPRUNG_TENDON = '<tendon><fixed name="t" stiffness="2"><joint joint="j" coef="3"/></fixed></tendon>'
DRIVEN = "data.qfrc_applied[0] = 4 * Math.sin(3 * data.time)"

MOTIONS: dict[str, tuple[float, str, dict[str, Any]]] = {
    "height of a throw": (
        3**2 / (2 * G), "m",
        {"xml": world(free(), gravity=DOWN), "setup": "data.qvel[2] = 3", "expr": "data.qpos[2]", "when": "max",
         "seconds": 0.6}),
    "width of a throw": (
        4 * 0.5, "m",
        {"xml": world(free(), gravity=DOWN), "setup": "data.qvel[0] = 4", "expr": X, "seconds": 0.5}),
    "slope of 30 degrees": (
        0.5 * G * math.sin(math.pi / 6) * 1.2**2, "m",
        {"xml": world(slide(axis="0.8660254 0 -0.5"), gravity=DOWN), "expr": X, "seconds": 1.2}),
    "torque on a wheel": (
        0.5 * 0.3 / 0.05 * 0.8**2, "rad",
        {"xml": world(wheel(0.05), more=actuator(f"<motor {TORQUE}/>")), "setup": "data.ctrl[0] = 0.3", "expr": X,
         "seconds": 0.8}),
    "gear of a motor": (
        7 * 0.3 / 0.05 * 0.5, "rad/s",
        {"xml": world(wheel(0.05), more=actuator(f'<motor {TORQUE} gear="7"/>')), "setup": "data.ctrl[0] = 0.3",
         "expr": V, "seconds": 0.5}),
    "armature adds inertia": (
        0.3 / (0.05 + 0.15) * 0.5, "rad/s",
        {"xml": world(wheel(0.05, 'armature="0.15"'), more=actuator(f"<motor {TORQUE}/>")),
         "setup": "data.ctrl[0] = 0.3", "expr": V, "seconds": 0.5}),
    "speed servo": (
        2 * (1 - math.exp(-3 / 2.0 * 0.7)), "m/s",
        {"xml": world(slide(), more=actuator(f'<velocity {TORQUE} kv="3"/>')), "setup": "data.ctrl[0] = 2", "expr": V,
         "seconds": 0.7}),
    "position servo, critically damped": (
        1 - (1 + 5 * 0.4) * math.exp(-5 * 0.4), "m",
        {"xml": world(slide(), more=actuator(f'<position {TORQUE} kp="50" kv="20"/>')), "setup": "data.ctrl[0] = 1",
         "expr": X, "seconds": 0.4}),
    "overshoot of a servo": (
        1 + math.exp(-math.pi * 0.2 / math.sqrt(1 - 0.2**2)), "m",
        {"xml": world(slide(), more=actuator(f'<position {TORQUE} kp="50" kv="4"/>')), "setup": "data.ctrl[0] = 1",
         "expr": X, "when": "max", "seconds": 2}),
    "overdamped": (
        decay(0.1, 50, 40, 2.0, 0.5), "m",
        {"xml": world(slide(joint='stiffness="50" damping="40"')), "setup": "data.qpos[0] = 0.1", "expr": X,
         "seconds": 0.5}),
    "critically damped": (
        0.1 * (1 + 5 * 0.3) * math.exp(-5 * 0.3), "m",
        {"xml": world(slide(joint='stiffness="50" damping="20"')), "setup": "data.qpos[0] = 0.1", "expr": X,
         "seconds": 0.3}),
    "sag of a spring at its lowest": (
        2 * 2.0 * G / 50, "m", {"xml": world(slide(joint='stiffness="50"'), gravity=ACROSS), "expr": X, "when": "max",
                                "seconds": 1.5}),
    "mean of whole periods": (
        2.0 * G / 50, "m",
        {"xml": world(slide(joint='stiffness="50"'), h=2 * math.pi / 5 / 1000, gravity=ACROSS), "expr": X,
         "when": "mean", "seconds": 4 * math.pi / 5}),
    "spring with a rest position": (
        0.3 * (1 - math.cos(5 * 0.4)), "m",
        {"xml": world(slide(joint='stiffness="50" springref="0.3"')), "expr": X, "seconds": 0.4}),
    "driven from rest": (
        4 / 2.0 / (5**2 - 3**2) * (math.sin(3 * 0.9) - 3 / 5 * math.sin(5 * 0.9)), "m",
        {"xml": world(slide(joint='stiffness="50"')), "controller": DRIVEN, "expr": X, "seconds": 0.9}),
    "driven without a spring": (
        4 / 2.0 * (1.1 / 3 - math.sin(3 * 1.1) / 9), "m",
        {"xml": world(slide()), "controller": DRIVEN, "expr": X, "seconds": 1.1}),
    "beat of two equal masses": (
        0.1 * (math.cos(math.sqrt(8) * 1.3) + math.cos(math.sqrt(14) * 1.3)) / 2, "m",
        {"xml": world(COUPLED), "setup": "data.qpos[0] = 0.1", "controller": COUPLING, "expr": X, "seconds": 1.3}),
    "the other mass of the beat": (
        0.1 * (math.cos(math.sqrt(8) * 1.3) - math.cos(math.sqrt(14) * 1.3)) / 2, "m",
        {"xml": world(COUPLED), "setup": "data.qpos[0] = 0.1", "controller": COUPLING, "expr": "data.qpos[1]",
         "seconds": 1.3}),
    "force through a tendon": (
        3 * 0.5 / 2.0 * 0.6, "m/s",
        {"xml": world(slide(), more=TENDON + actuator('<motor tendon="t"/>')), "setup": "data.ctrl[0] = 0.5",
         "expr": V, "seconds": 0.6}),
    "spring of a tendon": (
        0.1 * math.cos(3 * 0.7), "m",
        {"xml": world(slide(), more=SPRUNG_TENDON), "setup": "data.qpos[0] = 0.1", "expr": X, "seconds": 0.7}),
    "weight borne by a body": (
        0.0, "m",
        {"xml": world(free().replace("<body", '<body gravcomp="1"'), gravity=DOWN), "expr": "data.qpos[2]",
         "seconds": 1}),
    "half of the weight borne": (
        -0.25 * G * 0.8**2, "m",
        {"xml": world(free().replace("<body", '<body gravcomp="0.5"'), gravity=DOWN), "expr": "data.qpos[2]",
         "seconds": 0.8}),
    "integrated control": (
        0.4 * 0.9, "",
        {"xml": world(slide(), more=actuator(f'<intvelocity {TORQUE} kp="1" actrange="-9 9"/>')),
         "setup": "data.ctrl[0] = 0.4", "expr": "data.act[0]", "seconds": 0.9}),
    "exact filter": (
        2 * (1 - math.exp(-0.4 / 0.25)), "",
        {"xml": world(slide(), more=actuator(f'<general {TORQUE} dyntype="filterexact" dynprm="0.25"/>')),
         "setup": "data.ctrl[0] = 2", "expr": "data.act[0]", "seconds": 0.4}),
    "speed behind a filter": (
        1 / 2.0 * (0.8 - 0.3 * (1 - math.exp(-0.8 / 0.3))), "m/s",
        {"xml": world(slide(), more=actuator(f'<general {TORQUE} dyntype="filter" dynprm="0.3"/>')),
         "setup": "data.ctrl[0] = 1", "expr": V, "seconds": 0.8}),
    "time of a fall from 1 rad": (
        0.0, "rad",
        {"xml": world(rod(0.4), h=fall_time(1.0, 0.4) / 400, gravity=DOWN), "setup": "data.qpos[0] = 1", "expr": X,
         "seconds": fall_time(1.0, 0.4)}),
    "speed at the bottom of a compound pendulum": (
        math.sqrt(2 * 1.5 * G * 0.4 * (1 - math.cos(1.2)) / (1.5 * 0.4**2 + 0.06)), "rad/s",
        {"xml": world(rod(0.4, 1.5, 0.06), gravity=DOWN), "setup": "data.qpos[0] = 1.2", "expr": f"Math.abs({V})",
         "when": "max", "seconds": 1.2}),
    "a damped pendulum": (
        solve(lambda _, y: [y[1], -G / 0.4 * math.sin(y[0]) - 0.1 / 0.16 * y[1]], [1.0, 0.0], 0.9), "rad",
        {"xml": world(rod(0.4, joint='damping="0.1"'), gravity=DOWN), "setup": "data.qpos[0] = 1", "expr": X,
         "seconds": 0.9}),
    "a pendulum thrown over the top": (
        solve(lambda _, y: [y[1], -G / 0.4 * math.sin(y[0])], [0.0, 12.0], 0.7), "rad",
        {"xml": world(rod(0.4), gravity=DOWN), "setup": "data.qvel[0] = 12", "expr": X, "seconds": 0.7}),
    "cubic spring": (
        solve(lambda _, y: [y[1], -200 * y[0] ** 3], [0.4, 0.0], 0.8), "m",
        {"xml": world(slide()), "setup": "data.qpos[0] = 0.4",
         "controller": "data.qfrc_applied[0] = -400 * data.qpos[0] ** 3", "expr": X, "seconds": 0.8,
         "timestep": "any"}),
    "drag that grows with the square": (
        2.0 / 0.5 * math.log(1 + 0.5 * 6 / 2.0 * 0.9), "m",
        {"xml": world(slide()), "setup": "data.qvel[0] = 6",
         "controller": "data.qfrc_applied[0] = -0.5 * data.qvel[0] * Math.abs(data.qvel[0])", "expr": X,
         "seconds": 0.9, "timestep": "any"}),
    "escape from an unstable point": (
        0.01 * math.cosh(3 * 0.9), "m",
        {"xml": world(slide()), "setup": "data.qpos[0] = 0.01",
         "controller": "data.qfrc_applied[0] = 18 * data.qpos[0]", "expr": X, "seconds": 0.9, "timestep": "any"}),
    "energy left by a damper": (
        0.5 * 2.0 * 3**2 * math.exp(-2 * 4 / 2.0 * 0.3), "J",
        {"xml": world(slide(joint='damping="4"')), "setup": "data.qvel[0] = 3", "expr": ENERGY, "seconds": 0.3}),
    "energy of a swing": (
        -G * 0.4 * math.cos(2), "J",
        {"xml": world(rod(0.4), gravity=DOWN), "setup": "data.qpos[0] = 2", "expr": ENERGY, "seconds": 1}),
    "half turn of a free body": (
        math.sin(1.5 / 2), "",
        {"xml": world(free(".1 .1 .15")), "setup": "data.qvel[5] = 1.5", "expr": "data.qpos[6]", "seconds": 1}),
    "precession of a symmetric top": (
        0.3 * math.cos((0.15 / 0.1 - 1) * 4 * 0.9), "rad/s",
        {"xml": world(free(".1 .1 .15")), "setup": "data.qvel[3] = 0.3; data.qvel[5] = 4", "expr": "data.qvel[3]",
         "seconds": 0.9}),
    "path of a rolling speed": (
        1.3 + 2 * 0.7 - 0.5 * 0.9 * 0.7**2, "m",
        {"xml": world(slide()), "setup": "data.qpos[0] = 1.3; data.qvel[0] = 2",
         "controller": "data.qfrc_applied[0] = -1.8", "expr": X, "seconds": 0.7}),
    "a force that grows with time": (
        1.5 * 1.1**3 / 6 / 2.0, "m",
        {"xml": world(slide()), "controller": "data.qfrc_applied[0] = 1.5 * data.time", "expr": X, "seconds": 1.1}),
    "period of a spring, in ms": (
        1000 * 2 * math.pi / 5, "ms",
        {"xml": world(slide(joint='stiffness="50"')), "setup": "data.qpos[0] = 0.1", "expr": X, "when": "period",
         "seconds": 4}),
    "angular frequency of a spring": (
        5.0, "rad/s",
        {"xml": world(slide(joint='stiffness="50"')), "setup": "data.qpos[0] = 0.1", "expr": X, "when": "frequency",
         "seconds": 4}),
    "decay of a swing": (
        1.2 / (2 * 2.0), "1/s",
        {"xml": world(slide(joint='stiffness="50" damping="1.2"')), "setup": "data.qpos[0] = 0.1", "expr": X,
         "when": "decay_rate", "seconds": 6}),
    "settling of a speed": (
        math.log(3 / 0.1) * 2.0 / 4, "s",
        {"xml": world(slide(joint='damping="4"')), "setup": "data.qvel[0] = 3", "expr": V, "when": "settling",
         "band": 0.1, "level": 0, "seconds": 4}),
    "passes of a spring": (
        3, "",
        {"xml": world(slide(joint='stiffness="50"')), "setup": "data.qpos[0] = 0.1", "expr": X, "when": "crossings",
         "seconds": 4}),
    "first pass of a spring": (
        math.pi / 2 / 5, "s",
        {"xml": world(slide(joint='stiffness="50"')), "setup": "data.qpos[0] = 0.1", "expr": X, "when": "crossing",
         "direction": "down", "seconds": 1}),
    "peak to peak of a spring": (
        0.2, "m",
        {"xml": world(slide(joint='stiffness="50"')), "setup": "data.qpos[0] = 0.1", "expr": X, "when": "peak_to_peak",
         "since": 1, "seconds": 4}),
}  # fmt: skip
"""The truth, its unit, and how it is measured."""


@pytest.mark.parametrize("name", MOTIONS)
def test_the_true_number_is_certified_and_a_false_one_refuted(name: str) -> None:
    value, unit, verify = MOTIONS[name]
    tol = 0.01 * max(abs(value), 0.3)
    true = certify(numeric(value, tol, unit, by="measurement", **verify))
    assert (true.verdict, true.regime["failed"]) == ("certified", None), true.why
    false = certify(numeric(value + 4 * tol, tol, unit, by="measurement", **verify))
    assert false.verdict == "refuted", false.why


SWING = {"xml": world(rod(1.0, joint='damping="0.1"'), gravity=f"0 0 -{G}"), "setup": "data.qpos[0] = 2.6", "expr": X,
         "seconds": 16, "level": 0}  # fmt: skip
"""A pendulum that swings far at first, and faster and faster as its swing decays."""


def test_a_period_that_changes_is_none_unless_one_wave_is_named_or_the_tolerance_holds_them_all() -> None:
    times = np.arange(0, 16, 1e-3)
    angle = scipy.integrate.solve_ivp(
        lambda _t, y: [y[1], -G * math.sin(y[0]) - 0.1 * y[1]], (0, 16), [2.6, 0], t_eval=times, rtol=1e-11, atol=1e-13
    ).y[0]
    rises = times[:-1][(angle[:-1] < 0) & (angle[1:] >= 0)]  # to a millisecond
    waves = rises[1:] - rises[:-1]
    mean, spread = float(waves.mean()), float(abs(waves - waves.mean()).max())
    assert len(waves) > 4 and spread > 0.1

    refused = certify(numeric(mean, 0.05, "s", by="measurement", when="period", **SWING))
    assert (refused.verdict, refused.regime["failed"]) == ("cannot tell", "alike waves")
    told = [float(number) for number in re.findall(r"[0-9]+[.][0-9]+", refused.why)]
    assert told == pytest.approx([waves.min(), waves.max(), mean, 0.05], abs=0.002)
    by_run = certify(numeric(mean, 0.05, "s", by="measurement", when="period", timestep="given", **SWING))
    assert (by_run.verdict, by_run.regime["failed"]) == ("cannot tell", "alike waves")
    assert certify(numeric(1 / mean, 0.005, "Hz", by="measurement", when="frequency", **SWING)).verdict == "cannot tell"
    assert certify(numeric(2 * mean, 0.05, "s", by="measurement", when="period", **SWING)).verdict == "refuted"

    assert certify(numeric(mean, 1.1 * spread, "s", by="measurement", when="period", **SWING)).ok
    one = {"since": rises[1] - 0.1, "until": rises[2] + 0.1}
    assert certify(numeric(float(waves[1]), 0.01, "s", by="measurement", when="period", **SWING, **one)).ok


@pytest.mark.parametrize(("expr", "name"), [(X, "m"), (V, "m/s"), (ENERGY, "J"), (f"{X} * {X}", None)])
def test_a_question_without_a_unit_is_remarked_where_the_expression_has_one(expr: str, name: str | None) -> None:
    still = {"by": "measurement", "xml": world(slide()), "expr": expr, "seconds": 0.01}
    certificate = certify(numeric(0, 0.1, "", **still))
    assert certificate.ok, certificate.why
    told = [remark for remark in certificate.remarks if "the question has no unit" in remark]
    assert told == ([] if name is None else [remark for remark in told if f"a value in {name}, and" in remark])
    assert len(told) == (name is not None)


def test_a_decay_that_is_no_exponential_has_no_rate() -> None:
    """Dry friction takes the same from each swing, not the same share of it."""
    dry = {"xml": world(slide(joint='stiffness="50" frictionloss="0.2"')), "setup": "data.qpos[0] = 0.1", "expr": X,
           "when": "decay_rate", "seconds": 6}  # fmt: skip
    derived = certify(numeric(0, 0.01, "1/s", by="measurement", **dry)).answer
    assert derived is not None and derived > 0.1
    refused = certify(numeric(derived, 0.1 * derived, "1/s", by="measurement", **dry))
    assert (refused.verdict, refused.regime["failed"]) == ("cannot tell", "alike waves"), refused.why


@pytest.mark.parametrize("timestep", ["any", "given"])
def test_what_still_moves_at_the_end_of_the_run_has_not_settled(timestep: str) -> None:
    """Neither does a swing without a damper, nor a slow creep (rate k/c = 1/4 s): both have some last value."""
    settling = {"by": "measurement", "expr": X, "setup": "data.qpos[0] = 0.1", "when": "settling", "band": 0.01,
                "seconds": 6, "timestep": timestep}  # fmt: skip
    for joint, told in (('stiffness="50"', 5.98), ('stiffness="5" damping="20"', 4.54)):
        refused = certify(numeric(told, 0.02, "s", xml=world(slide(joint=joint)), **settling))
        assert (refused.verdict, refused.regime["failed"]) == ("cannot tell", "settled"), refused.why
        assert "in one of 9 s it settles at" in refused.why
    slow, fast = ((20 - sign * math.sqrt(20**2 - 4 * 2 * 5)) / (2 * 2) for sign in (1, -1))
    right = math.log(0.1 * fast / (fast - slow) / 0.01) / slow  # the fast mode is gone by then
    rest = settling | {"seconds": 11, "level": 0}
    creep = world(slide(joint='stiffness="5" damping="20"'))
    assert certify(numeric(right, 0.02, "s", xml=creep, **rest)).ok


@pytest.mark.parametrize(
    "window", [{"seconds": 60}, {"seconds": 30, "until": 20}, {"seconds": 30, "until": 19.792, "level": 0}]
)
def test_a_swing_does_not_settle_in_the_longest_run_nor_in_a_part_of_one(window: dict[str, float]) -> None:
    swing = {"by": "measurement", "expr": X, "setup": "data.qpos[0] = 0.1", "when": "settling", "band": 0.01, **window}
    told = window.get("until", 60) - 0.02
    refused = certify(numeric(told, 0.05, "s", xml=world(slide(joint='stiffness="50"'), h=4e-3), **swing))
    assert (refused.verdict, refused.regime["failed"]) == ("cannot tell", "settled"), refused.why
    brake = world(slide(joint='stiffness="50" damping="20"'), h=4e-3)  # critically damped, at 5 rad/s
    rest = certify(numeric(0.777945, 0.05, "s", xml=brake, **swing))
    assert rest.ok, rest.why


@pytest.mark.parametrize("when", ["max", "min", "amplitude", "peak_to_peak"])
@pytest.mark.parametrize("begin", [0, 0.5])
def test_the_extremes_of_a_force_that_jumps_are_those_of_its_frames(when: str, begin: float) -> None:
    """A motor of 10 N, switched on: a parabola through the frames beside the jump would have its top at 11.25 N."""
    motor = world(slide(joint='damping="20"'), more='<actuator><motor joint="j"/></actuator>')
    truth = {"max": 10, "min": 0, "amplitude": 5, "peak_to_peak": 10}[when]
    sign = -1 if when == "min" else 1
    told = {"by": "measurement", "xml": motor, "expr": "data.actuator_force[0]", "when": when, "seconds": 1,
            "controller": f"data.ctrl[0] = data.time >= {begin} ? {10 * sign} : 0"}  # fmt: skip
    key = -10 if when == "min" else truth
    right = certify(numeric(key, 0.1, "N", **told))
    assert right.ok, right.why
    wrong = certify(numeric(1.125 * key, 0.1, "N", **told))
    assert wrong.verdict == "refuted", wrong.why


def test_the_largest_speed_of_a_fall_is_that_before_the_impact() -> None:
    """From 0.9 m: sqrt(2 g d) in the limit of short timesteps."""
    floor = (
        '<geom type="plane" size="1 1 .1"/><body pos="0 0 1"><joint type="slide" axis="0 0 1"/><geom size=".1"/></body>'
    )
    ball = world(floor, gravity="0 0 -9.81", h=5e-4)
    speed = math.sqrt(2 * 9.81 * 0.9)
    told = {"by": "measurement", "xml": ball, "expr": "-data.qvel[0]", "when": "max", "seconds": 0.6}
    right = certify(numeric(speed, 0.05, "m/s", **told))
    assert right.ok, right.why
    assert certify(numeric(speed + 0.06, 0.05, "m/s", **told)).verdict != "certified"


def test_a_start_on_the_edge_is_told_whatever_direction_it_falls_to() -> None:
    """A buckling spring between two sliders stays straight where both are shifted alike; a body that turns about its
    middle axis (Dzhanibekov) where its positions alone are."""
    sliders = """<body><joint type="slide" axis="0 1 0"/><geom size=".05" mass="1"/><site name="a"/></body>
      <body pos="1 0 0"><joint type="slide" axis="0 1 0"/><geom size=".05" mass="1"/><site name="b"/></body>"""
    spring = '<spatial springlength="2" stiffness="100" damping="1"><site site="a"/><site site="b"/></spatial>'
    buckles = {
        "xml": world(sliders, more=f"<tendon>{spring}</tendon>"),
        "expr": "data.qpos[1] - data.qpos[0]",
        "when": "end",
        "seconds": 10,
    }
    spins = {"xml": world('<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 2 3"/></body>'),
             "setup": "data.qvel[4] = 5", "expr": "data.xmat[13]", "when": "min", "seconds": 20}  # fmt: skip
    for told, stays in ((buckles, 0), (spins, 1)):
        certificate = certify(numeric(stays, 0.01, "", by="measurement", **told))
        assert (certificate.verdict, certificate.regime["failed"]) == ("cannot tell", "nudged starts"), certificate.why


def test_a_rate_of_peaks_above_0_is_remarked_where_the_swing_is_about_something_else() -> None:
    """Damped by c/2m = 1/4 1/s, about 1 m."""
    swing = {"by": "measurement", "xml": world(slide(joint='stiffness="50" damping="1" springref="1"')), "expr": X,
             "setup": "data.qpos[0] = 1.5", "when": "decay_rate", "seconds": 6}  # fmt: skip
    above = certify(numeric(0.1, 10, "1/s", **swing))
    assert above.ok, above.why
    assert [remark for remark in above.remarks if "the swing is about 1" in remark], above.remarks
    about = certify(numeric(0.25, 0.005, "1/s", **swing, level=1))
    assert about.ok and not about.remarks, about.why


BLADE = """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody>
  <body><joint axis="0 0 1"/><geom type="box" size="1 .002 .05" mass="10"/></body>
  <body pos="0 .8 0"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
    <geom size=".005" mass=".1"/></body>
</worldbody></mujoco>"""
BULLET = """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody>
  <body pos=".525 0 0"><geom name="wall" type="box" size=".002 .5 .5" contype="0" conaffinity="0"/></body>
  <body><joint type="slide" axis="1 0 0"/>
    <geom name="ball" size=".005" mass=".1" contype="0" conaffinity="0"/></body></worldbody>
  <contact><pair geom1="wall" geom2="ball" solref="-1e8 -2000" solimp=".99 .999 .001"/></contact></mujoco>"""


@pytest.mark.parametrize(
    ("xml", "expr", "missed"),
    [(BLADE, "Math.hypot(data.qvel[1], data.qvel[2])", 0), (BULLET, "data.qpos[0]", 2)],
    ids=["a blade that turns", "a wall of a pair"],
)
def test_what_flies_through_at_the_own_timestep_is_not_certified(xml: str, expr: str, missed: float) -> None:
    told = {"by": "measurement", "xml": xml, "setup": "data.qvel[0] = 100", "expr": expr, "seconds": 0.02}
    assert certify(numeric(missed, 0.05, "", **told)).verdict == "refuted"


def test_an_activation_at_its_limit_is_no_mode_of_the_motion() -> None:
    held = """<mujoco><worldbody><body><joint name="j" type="slide"/><geom size=".1"/></body></worldbody><actuator>
      <general joint="j" dyntype="integrator" actlimited="true" actrange="0 .5"/></actuator></mujoco>"""
    told = {"by": "measurement", "xml": held, "setup": "data.ctrl[0] = 1", "expr": "data.act[0]", "when": "max"}
    certificate = certify(numeric(0.5, 0.01, "", seconds=2, **told))
    assert certificate.ok, certificate.why


@pytest.mark.parametrize("timestep", ["any", "given"])
def test_a_peak_that_still_grows_at_the_end_of_the_run_is_remarked(timestep: str) -> None:
    """A swing from 0 at 3 m/s with 5 rad/s has its peak, 0.6 m, after 0.314 s."""
    swing = {"by": "measurement", "xml": world(slide(joint='stiffness="50"')), "setup": "data.qvel[0] = 3", "expr": X,
             "timestep": timestep}  # fmt: skip
    for when, peak in (("max", 0.6), ("amplitude", 0.6), ("peak_to_peak", 1.2), ("min", -0.6)):
        whole = certify(numeric(peak, 0.01, "m", **swing, when=when, seconds=2))
        assert whole.ok and not whole.remarks, (when, whole.why, whole.remarks)
    early = 0.6 * math.sin(5 * 0.2)
    cut = certify(numeric(early, 0.01, "m", **swing, when="max", seconds=0.2))
    assert cut.ok, cut.why
    assert [remark for remark in cut.remarks if remark.startswith("The max changes by 0.03")], cut.remarks
    assert not certify(numeric(early, 0.01, "m", **swing, when="max", seconds=1, until=0.2)).remarks


def test_a_beat_has_not_settled_in_its_quiet_part() -> None:
    """Two coupled masses with frequencies of 2.83 and 3.74 rad/s: the first one rests after 3.5 s, and swings as far as
    before 7 s after its start, and every 7 s."""
    seconds, beat = 2.8, {"by": "measurement", "xml": world(COUPLED), "controller": COUPLING, "expr": X}
    start = {"setup": "data.qpos[0] = 0.1", "when": "settling", "band": 0.06, "level": 0}
    times = np.linspace(0, seconds, 100_001)
    swing = 0.05 * (np.cos(math.sqrt(8) * times) + np.cos(math.sqrt(14) * times))
    settled = times[np.flatnonzero(np.abs(swing) > 0.06)[-1] + 1]
    certificate = certify(numeric(float(settled), 0.05, "s", **beat, **start, seconds=seconds))
    assert certificate.verdict == "cannot tell"
    assert "settle" in certificate.why


@pytest.mark.parametrize(("seconds", "timestep"), [(16, "given"), (20, "given"), (20, "both"), (30, "given")])
def test_a_toss_is_no_key_whichever_way_it_falls(seconds: float, timestep: str) -> None:
    """Where the double pendulum points then is decided by less than 1e-10: of starts nudged by it, half point either
    way."""
    claims = ["Math.sin(data.qpos[0]) > 0", "Math.sin(data.qpos[0]) < 0"]
    verify = {"by": "outcome", "claims": claims, "seconds": seconds, "timestep": timestep}
    for answer in (0, 1):
        question = predict(["left", "right"], answer, {"model": "double_pendulum", "key": "release"}, verify)
        assert certify(question).verdict == "cannot tell"


def test_a_turn_about_the_middle_axis_is_not_taken_for_steady() -> None:
    """It flips again and again, at moments that less than 1e-10 decides; two nudged starts may be back together."""
    box = world(free(".01 .02 .03"))
    spin = {"by": "measurement", "xml": box, "setup": "data.qvel[4] = 6", "expr": "data.qvel[4]"}
    assert certify(numeric(6, 0.12, "rad/s", **spin, seconds=1)).ok
    assert certify(numeric(6, 0.12, "rad/s", **spin, seconds=20)).verdict == "cannot tell"


STIFFNESSES = [0.02 * 1.4**i for i in range(9)]


@pytest.mark.cost
@pytest.mark.parametrize("kp", STIFFNESSES)
@pytest.mark.parametrize("beyond", [1.02 + 0.025 * i for i in range(15)])
def test_no_soft_servo_beyond_its_limit_is_certified_stable(kp: float, beyond: float) -> None:
    assert certify(soft_servo(kp, beyond, 0)).verdict != "certified"


@pytest.mark.cost
@pytest.mark.parametrize("kp", STIFFNESSES)
@pytest.mark.parametrize("below", [0.2 + 0.065 * i for i in range(12)])
def test_every_soft_servo_below_its_limit_is_still_certified_stable(kp: float, below: float) -> None:
    assert certify(soft_servo(kp, below, 0)).verdict == "certified"
