"""A certified key whose question says otherwise is remarked on; words that fit are left alone."""

from typing import Any

import pytest

from grader.certify import certify_key
from grader.domain.verify import ByMeasurement
from grader.questions import NumberKey

SWING = """<mujoco><option integrator="RK4"/><worldbody><body><joint type="hinge" axis="0 1 0"/>
<geom size=".05" pos="0 0 -.5"/></body></worldbody></mujoco>"""


def remark(text: str, **changes: Any) -> tuple[str, ...]:
    raw = {"by": "measurement", "xml": SWING, "expr": "data.qpos[0]", "seconds": 1, "setup": "data.qpos[0] = 0.5"}
    verify = ByMeasurement.model_validate(raw | changes)
    key = NumberKey(kind="numeric", text=text, verify=verify, answer=0, tolerance=1e3, unit="rad")
    certificate = certify_key(key, dict[str, str]().__getitem__)
    assert certificate is not None and certificate.ok, certificate
    return certificate.remarks


@pytest.mark.parametrize(
    ("text", "changes", "told"),
    [
        ("How far has it turned after 2 s?", {}, "name 2 s, and verify.seconds ends the run at 1 s"),
        ("What is the largest angle?", {"when": "mean"}, "ask for the largest, and verify.when measures the mean"),
        ("What is its lowest angle?", {"when": "max"}, "ask for the smallest"),
        ("What is the amplitude?", {"when": "peak_to_peak"}, "measures the peak to peak"),
        ("Where is it after 1 s under Euler?", {}, "integrator Euler, and the model's is RK4"),
        ("It starts at 30 °. Where is it after 1 s?", {"setup": "data.qpos[0] = 30"}, "30 * Math.PI / 180"),
        ("Where is it after 1 s?", {"expr": "data.qpos[0] * Math.sin(30)"}, "in radians"),
    ],
)
def test_words_that_say_otherwise_are_remarked_on(text: str, changes: dict[str, Any], told: str) -> None:
    assert [one for one in remark(text, **changes) if told in one]


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("How far has it turned after 1 s under RK4?", {}),
        ("How far has it turned after 1000 ms?", {}),
        ("What is the largest angle?", {"when": "max", "seconds": 4}),
        ("What is the lowest point?", {"expr": "-data.qpos[0]", "when": "max", "seconds": 4}),
        ("Pushed after 2 s and again after 3 s, where does it end up?", {}),
        ("Where is it after 1 s with Euler?", {"setup": "model.opt.integrator = 0; data.qpos[0] = 0.5"}),
        ("It starts at 0.5 rad, with implicit damping. Where is it after 1 s?", {}),
        ("Where is it after 1 s?", {"expr": "data.qpos[0] * Math.sin(0.5)"}),
    ],
)
def test_words_that_fit_are_left_alone(text: str, changes: dict[str, Any]) -> None:
    assert remark(text, **changes) == ()
