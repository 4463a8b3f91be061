"""A certified key whose question says otherwise is remarked on; words that fit are left alone."""

from typing import Any

import pytest

from grader.certify import certify_key
from grader.domain.verify import ByMeasurement, ByStage, ByThreshold
from grader.questions import NumberKey, OptionKey

SWING = """<mujoco><option integrator="RK4"/><worldbody><body><joint type="hinge" axis="0 1 0"/>
<geom size=".05" pos="0 0 -.5"/></body></worldbody></mujoco>"""


def remark(text: str, **changes: Any) -> tuple[str, ...]:
    raw = {"by": "measurement", "xml": SWING, "expr": "data.qpos[0]", "seconds": 1, "setup": "data.qpos[0] = 0.5"}
    verify = ByMeasurement.model_validate(raw | changes)
    key = NumberKey(kind="numeric", text=text, verify=verify, answer=1e-6, tolerance=1e3, unit="rad")
    certificate = certify_key(key, dict[str, str]().__getitem__)
    assert certificate is not None and certificate.ok, certificate
    return certificate.remarks


@pytest.mark.parametrize(
    ("text", "changes", "told"),
    [
        ("How far has it turned after 2 s?", {}, "name 2 s, and verify.seconds ends the run at 1 s"),
        ("Where is it after two seconds?", {}, "name 2 s, and verify.seconds ends the run at 1 s"),
        ("Where is it 2 seconds later?", {}, "name 2 s"),
        ("Where is it at time 2.0 s?", {}, "name 2 s"),
        ("Where is it two seconds after release?", {}, "name 2 s"),
        ("Where is it when t=2s?", {}, "name 2 s"),
        ("It is let go at t = 0 s. Where is it after 2 sec?", {}, "name 2 s"),
        ("Where is it after 2000 milliseconds?", {}, "name 2 s"),
        (
            "What is the final angle?",
            {"when": "max"},
            "ask for the value at the end, and verify.when measures the largest",
        ),
        ("Which angle has it at the end of the run?", {"when": "mean"}, "ask for the value at the end"),
        ("What is the root mean square of the angle?", {"when": "mean"}, "ask for the root mean square"),
        ("What is the mean angle?", {"when": "rms"}, "measures the root mean square"),
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


def remark_other(text: str, key: dict[str, Any], **verify: Any) -> tuple[str, ...]:
    """The remarks on a key by a threshold or a stage."""
    way = ByStage if verify["by"] == "stage" else ByThreshold
    kind = OptionKey if "options" in key else NumberKey
    certificate = certify_key(kind(text=text, verify=way.model_validate(verify), **key), dict[str, str]().__getitem__)
    assert certificate is not None and certificate.ok, certificate
    return certificate.remarks


SERVO = {"inertia": 0.25, "kp": 20000, "kv": 50}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("The largest stable timestep under RK4?", "name the integrator RK4, and verify.integrator is Euler"),
        ("The largest stable timestep under Euler?", ""),
        ("The largest stable timestep? Compare Euler with RK4.", ""),
    ],
)
def test_the_integrator_of_a_threshold_is_compared(text: str, told: str) -> None:
    key = {"kind": "numeric", "answer": 5.0, "tolerance": 0.5, "unit": "ms"}
    told_of = remark_other(text, key, by="threshold", servo=SERVO, integrator="Euler")
    assert [one for one in told_of if "integrator" in one and told in one] if told else not told_of


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Which stage of mj_step fills <code>cvel</code>?", "name data.cvel, and verify.fills is xpos"),
        ("Which stage of mj_step fills <code>xpos</code>?", ""),
        ("Which stage computes where bodies are?", ""),
    ],
)
def test_the_field_of_a_stage_is_compared(text: str, told: str) -> None:
    options = ("Position stage", "Velocity stage")
    told_of = remark_other(text, {"kind": "mcq", "answer": 0, "options": options}, by="stage", fills="xpos")
    assert [one for one in told_of if told in one] if told else not told_of


def test_a_tolerance_about_0_is_compared_with_the_run() -> None:
    swing = {"xml": SWING, "expr": "data.qpos[0]", "seconds": 1, "setup": "data.qpos[0] = 0.5"}
    verify = ByMeasurement.model_validate({"by": "measurement", "timestep": "given", **swing})
    for tolerance, is_told in ((1.0, True), (0.45, False)):
        key = NumberKey(kind="numeric", text="Where?", verify=verify, answer=0, tolerance=tolerance, unit="rad")
        certificate = certify_key(key, dict[str, str]().__getitem__)
        assert certificate is not None
        assert any("give a smaller one" in one for one in certificate.remarks) is is_told, certificate


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("How far has it turned after 1 s under RK4?", {}),
        ("How far has it turned after 1000 ms?", {}),
        ("Where is it one second after its release at t = 0 s?", {}),
        ("It is held for 0.5 s. Where is it half a second, or 0.25 s later?", {}),
        ("It is held for 0.4 s. Where is it 0.6 s later?", {}),
        ("It hangs at the end of a rod. How high does it get?", {"when": "max", "seconds": 4}),
        ("After 2 s in which it hangs, how high does it get?", {"when": "max", "seconds": 4}),
        ("What is the rms of the angle?", {"when": "rms", "seconds": 4}),
        ("What is the root mean square of the angle?", {"when": "rms", "seconds": 4}),
        ("What is the largest angle by which it ends up?", {"when": "max", "seconds": 4}),
        ("What is the final angle?", {}),
        ("What is the largest angle?", {"when": "max", "seconds": 4}),
        ("How fast is it at its lowest point?", {"when": "max", "seconds": 4}),
        ("What is the lowest point?", {"expr": "-data.qpos[0]", "when": "max", "seconds": 4}),
        ("Pushed after 2 s and again after 3 s, where does it end up?", {}),
        ("Where is it after 1 s with Euler?", {"setup": "model.opt.integrator = 0; data.qpos[0] = 0.5"}),
        ("It starts at 0.5 rad, with implicit damping. Where is it after 1 s?", {}),
        ("Where is it after 1 s?", {"expr": "data.qpos[0] * Math.sin(0.5)"}),
    ],
)
def test_words_that_fit_are_left_alone(text: str, changes: dict[str, Any]) -> None:
    assert remark(text, **changes) == ()
