"""A certified number is remarked on where the series that it is measured in shows something else than its question."""

from typing import Any

import pytest

from grader.certify import Certificate, certify_key
from grader.domain.verify import ByMeasurement
from grader.questions import NumberKey

BALL = """<mujoco><option integrator="RK4"/><worldbody><body><joint type="slide" axis="0 0 1"/>
<geom size=".1" mass="1"/></body></worldbody></mujoco>"""
SPRING = """<mujoco><option gravity="0 0 0" integrator="RK4"/><worldbody><body>
<joint type="slide" axis="1 0 0" stiffness="39.4784176" damping="1"/><geom size="0.1" mass="1"/></body>
</worldbody></mujoco>"""
TURN = """<mujoco><option gravity="0 0 0" integrator="RK4"/><worldbody><body><joint axis="0 1 0"/>
<geom size=".1" pos=".3 0 0" mass="1"/></body></worldbody></mujoco>"""


def certify(text: str, unit: str, answer: float, **verify: Any) -> Certificate:
    way = ByMeasurement.model_validate({"by": "measurement", "seconds": 0.5, **verify})
    key = NumberKey(kind="numeric", text=text, verify=way, answer=answer, tolerance=0.01, unit=unit)
    certificate = certify_key(key, dict[str, str]().__getitem__)
    assert certificate is not None and certificate.ok, certificate
    return certificate


FALL = {"xml": BALL, "expr": "data.qvel[0]", "when": "max"}
SWING = {"xml": SPRING, "setup": "data.qpos[0] = 0.5", "expr": "data.qvel[0]", "when": "max", "seconds": 3}


@pytest.mark.parametrize(
    ("text", "unit", "answer", "verify", "size"),
    [
        ("What is the largest speed of the falling ball within 0.5 s?", "m/s", 0, FALL, "4.905"),
        ("How far from the start does the ball get?", "m", 0, FALL | {"expr": "data.qpos[0]"}, "1.226"),
        ("How fast is it at most?", "m/s", 2.17, SWING, "2.7"),
        ("What is its mean speed?", "m/s", -2.4525, FALL | {"when": "mean"}, "2.45"),
        ("What is the mean speed over 0.5 s?", "m/s", -2.4525, FALL | {"when": "mean"}, "2.45"),
        ("How far does it overshoot its rest?", "m", 0.39, SWING | {"expr": "-data.qpos[0]"}, ""),
        ("How fast is it at most?", "m/s", 4.905, FALL | {"expr": "-data.qvel[0]"}, ""),
        ("How fast is it at most?", "m/s", 4.905, FALL | {"expr": "Math.abs(data.qvel[0])"}, ""),
        ("What is the largest velocity?", "m/s", 0, FALL, ""),
        ("How fast does it get upwards at most?", "m/s", 0, FALL, ""),
        ("It is let go with a speed of 0 m/s. What is its largest velocity?", "m/s", 0, FALL, ""),
        ("How fast must it be, to get as high as that?", "m", 0, FALL | {"expr": "data.qpos[0]"}, ""),
        ("How far does it swing at most?", "m", 0.5, SWING | {"expr": "data.qpos[0]"}, ""),
    ],
)
def test_a_sign_is_remarked_where_the_words_ask_for_a_size(
    text: str, unit: str, answer: float, verify: dict[str, Any], size: str
) -> None:
    told = [one for one in certify(text, unit, answer, **verify).remarks if "ask for a size" in one]
    assert [one for one in told if f"of its size is {size}" in one] if size else not told


SPIN = {"xml": TURN, "setup": "data.qpos[0] = 0.1; data.qvel[0] = 10", "seconds": 3}


@pytest.mark.parametrize(
    ("answer", "verify", "is_told"),
    [
        (9, {"expr": "Math.atan2(Math.sin(data.qpos[0]), Math.cos(data.qpos[0]))", "when": "crossings",
              "direction": "either"}, True),
        (4, {"expr": "Math.atan2(Math.sin(data.qpos[0]), Math.cos(data.qpos[0]))", "when": "crossings"}, False),
        (9, {"expr": "Math.sin(data.qpos[0])", "when": "crossings", "direction": "either"}, False),
    ],
)  # fmt: skip
def test_an_angle_that_wraps_over_the_level_is_remarked(answer: int, verify: dict[str, Any], is_told: bool) -> None:
    remarks = certify("How often?", "", answer, **SPIN, **verify).remarks
    assert any("where it wraps" in one for one in remarks) is is_told
